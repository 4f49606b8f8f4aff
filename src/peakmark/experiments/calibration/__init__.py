"""How good a calibration is: simulated cameras whose truth is known, beside OpenCV's boards on the same poses."""
