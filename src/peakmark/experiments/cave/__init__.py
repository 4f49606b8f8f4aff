"""The CAVE: a room of posters with marker arrays, its evaluation, training and rivals."""
