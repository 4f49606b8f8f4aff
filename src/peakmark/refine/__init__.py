"""Alignment of a marker's printed pattern with an image: centre, shape, covariance."""

from peakmark.refine.api import Refined, refine

__all__ = ["Refined", "refine"]
