"""Settings of the whole suite."""

import signal

from hypothesis import settings
from hypothesis.internal.conjecture import providers

# examples come from a fixed seed, so that a run can be repeated; first calls import and compile, so no deadline
settings.register_profile("peakmark", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("peakmark")

# Hypothesis mixes in constants of the modules that a process happens to have imported: other examples in every run
if hasattr(providers, "_get_local_constants"):
    providers._get_local_constants = providers.Constants

# a shell that starts the suite in the background lets it, and what it starts, ignore Ctrl-C, which tests send
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
