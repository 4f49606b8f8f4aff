"""Alignment of a marker's printed pattern with an image: centre, shape, covariance."""

from peakmark.refine.api import Refined, refine
from peakmark.refine.round import circle_centers

__all__ = ["Refined", "circle_centers", "refine"]
