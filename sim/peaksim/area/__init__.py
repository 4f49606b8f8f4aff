"""The exact renderer: every pixel is the mean of what it shows over its area."""

from peaksim.area.integrate import integrate

__all__ = ["integrate"]
