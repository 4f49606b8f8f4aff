"""Rays of many images meet in the points that they saw, whatever else they show."""

import numpy as np
import pytest
from peaksim.geometry.pose import compose, rotation_about

from peakmark.errors import InputError
from peakmark.mapping.intersect import intersect_sightings

POINTS = {"dark": np.array([(0.1, 0.2, 2.0), (-0.3, 0.1, 2.2)]), "light": np.array([(0.0, -0.2, 1.9)])}


def test_points_come_back_from_rays_that_look_alike() -> None:
    rng = np.random.default_rng(0)
    poses = np.array(
        [compose(rotation_about("y", -6.0 * k)[:3, :3], [0.25 * k - 0.6, 0.02 * k, 0.0]) for k in range(6)]
    )
    rays, labels = [], []
    for pose in poses:
        seen = [(name, (p - pose[:3, 3]) @ pose[:3, :3]) for name, points in POINTS.items() for p in points]
        seen.append(("dark", np.array([*rng.uniform(-0.3, 0.3, 2), 1.0])))  # a false one in each image
        rays.append([p[:2] / p[2] + rng.normal(0, 1e-5, 2) for _, p in seen])
        labels.append([name for name, _ in seen])
    found = intersect_sightings(poses, rays, labels, within=5e-4, least=4)
    assert sorted(one.label for one in found) == ["dark", "dark", "light"]
    for one in found:
        assert np.linalg.norm(POINTS[one.label] - one.xyz, axis=1).min() < 1e-3
        assert len(one.sightings) == 6


def test_what_does_not_belong_together_is_named() -> None:
    with pytest.raises(InputError, match="rays: expected those of 1 views, got 0"):
        intersect_sightings(np.eye(4)[None], [], [])
    assert intersect_sightings(np.empty((0, 4, 4)), [], []) == []
