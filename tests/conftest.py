"""Settings of the whole suite."""

from hypothesis import settings

# examples come from a fixed seed, so that a run can be repeated; first calls import and compile, so no deadline
settings.register_profile("peakmark", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("peakmark")
