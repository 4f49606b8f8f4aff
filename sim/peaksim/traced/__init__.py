"""The path-traced renderer: global illumination, soft shadows, gloss and depth of field, through our own cameras."""

from peaksim.traced.bake import bake_light, lit_scene
from peaksim.traced.inside import check_lights
from peaksim.traced.integrate import MAX_DEPTH, MOST_SAMPLES, SAMPLES, check, integrate
from peaksim.traced.library import fault, is_available
from peaksim.traced.light_cache import cached_light

__all__ = [
    "MAX_DEPTH",
    "MOST_SAMPLES",
    "SAMPLES",
    "bake_light",
    "cached_light",
    "check",
    "check_lights",
    "fault",
    "integrate",
    "is_available",
    "lit_scene",
]
