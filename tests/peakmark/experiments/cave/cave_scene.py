"""A small room with two arrays, a full block of four and a blank poster, for quick runs."""

SMALL_CAVE = """
[camera]
width = 640
height = 480
fx = 620.0
[sensor]
lens_blur_px = 0.5
read_noise = 2.0
[[trajectory]]
time_s = 0.0
eye_m = [0.0, 2.7, 1.4]
target_m = [0.0, 4.0, 1.4]
[[trajectory]]
time_s = 1.0
eye_m = [0.2, 2.8, 1.45]
target_m = [0.0, 4.0, 1.4]
[textures.wall]
file = "textures/brick.png"
photo_m = 1.6
contrast = 0.5
mean = 150
[room]
min_m = [-2.0, 0.0, 0.0]
max_m = [2.0, 4.0, 2.5]
floor = "wall"
[[posters]]
name = "array3"
rows = [".D", "LL"]
side_m = 0.06
pitch_m = 0.09
center_m = [-0.3, 3.998, 1.4]
normal = [0, -1, 0]
turn_deg = 20
[[posters]]
name = "array6"
rows = [".L", "LD"]
side_m = 0.06
pitch_m = 0.09
center_m = [0.25, 3.998, 1.5]
normal = [0, -1, 0]
[[posters]]
name = "block"
rows = ["DL", "LD"]
side_m = 0.06
pitch_m = 0.09
center_m = [0.1, 3.998, 1.12]
normal = [0, -1, 0]
[[posters]]
name = "blank"
rows = [".."]
side_m = 0.06
pitch_m = 0.09
center_m = [-0.5, 3.998, 1.05]
normal = [0, -1, 0]
"""
