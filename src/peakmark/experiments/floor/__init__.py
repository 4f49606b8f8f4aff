"""The lab floor: one frame, flights over it, and flights on floors never tuned for."""
