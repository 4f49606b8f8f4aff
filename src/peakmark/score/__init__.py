"""Detections against truth: matches, rates with intervals, errors of positions and poses."""

from peakmark.score.markers import Score, score_frame

__all__ = ["Score", "score_frame"]
