"""Images from anywhere, with or without truth: what `identify`, AprilTag and ArUco find in them, side by side."""
