"""Photographs of arrays anywhere → a map of where each hangs: bundle adjustment."""

from peakmark.mapping.adjust import BuiltMap, build_map
from peakmark.mapping.sightings import Sighting, sightings_of

__all__ = ["BuiltMap", "Sighting", "build_map", "sightings_of"]
