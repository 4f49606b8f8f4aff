"""Regression: a detector over rendered fly-throughs, its figures beside accepted ones, frame by frame.

::

    suite.toml ─▶ suite ─▶ frames (render, detect, score) ─▶ record ─▶ metrics ─▶ compare with a baseline ─▶ reports
"""
