"""Recordings that robotics tools open: MCAP with ROS 2 messages, and Rerun; and the images of bags."""

from peakmark.recording.bag import is_bag, read_bag
from peakmark.recording.moment import Moment
from peakmark.recording.recorder import ENDINGS, check_recording, recorder

__all__ = ["ENDINGS", "Moment", "check_recording", "is_bag", "read_bag", "recorder"]
