"""The path-traced renderer: global illumination, soft shadows, gloss and depth of field, through our own cameras."""

from peaksim.traced.integrate import MAX_DEPTH, MOST_SAMPLES, SAMPLES, check, integrate
from peaksim.traced.library import is_available

__all__ = ["MAX_DEPTH", "MOST_SAMPLES", "SAMPLES", "check", "integrate", "is_available"]
