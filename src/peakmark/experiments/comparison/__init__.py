"""Our markers, arrays and binary markers beside tags, rings and corners of the same printed area in the same frames."""
