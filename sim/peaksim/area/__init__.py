"""The exact renderer: every pixel is the integral of what it sees over its area."""

from peaksim.area.integrate import integrate

__all__ = ["integrate"]
