"""Feature points of dense walls: geometry by projection, posters make the difference, bad scenes are refused."""

from dataclasses import replace

import numpy as np
import pytest
from peaksim.geometry.pose import invert, transform
from peaksim.scene.file import load_scene

from peakmark.errors import InputError
from peakmark.experiments.cave.dense_wall import (
    APART_DEG,
    DISTANCE_M,
    count_features,
    on_plane,
    patch_of,
    repeats,
    two_views,
)
from tests.samples import some_keypoints

CAVE = load_scene("cave")
SMALL = replace(CAVE.camera, width=320, height=240, fx=312.0, fy=312.0, cx=159.5, cy=119.5)


def test_the_patch_covers_all_copies_and_the_views_are_apart() -> None:
    patch = patch_of(CAVE.scene, "mixed")
    width, height = (np.linalg.norm(patch.corners_m[k] - patch.corners_m[0]) for k in (1, 3))
    assert width == pytest.approx(7 * 0.215 + 0.21, abs=0.001)
    assert height == pytest.approx(2 * 0.305 + 0.297, abs=0.001)
    left, right = two_views(patch)
    middle = patch.corners_m.mean(axis=0)
    for pose in (left, right):
        assert np.linalg.norm(pose[:3, 3] - middle) == pytest.approx(DISTANCE_M)
    cosine = (left[:3, 3] - middle) @ (right[:3, 3] - middle) / DISTANCE_M**2
    assert np.degrees(np.arccos(cosine)) == pytest.approx(APART_DEG)


def test_points_on_the_wall_project_back_to_their_pixels() -> None:
    patch = patch_of(CAVE.scene, "dark")
    pose, _ = two_views(patch)
    xy = np.random.default_rng(0).uniform(0, 200, (20, 2))
    points = on_plane(SMALL, pose, patch, xy)
    assert np.allclose((points - patch.corners_m[0]) @ patch.normal, 0, atol=1e-9)
    assert np.allclose(SMALL.project(transform(invert(pose), points)), xy, atol=1e-6)


def test_what_is_seen_again_repeats_and_what_is_moved_or_scaled_does_not() -> None:
    patch = patch_of(CAVE.scene, "dark")
    poses = two_views(patch)
    positions = np.stack(np.meshgrid([100, 140, 180, 220], [90, 150]), -1).reshape(-1, 2).astype(np.float32)
    first = some_keypoints(8).with_columns(xy=positions)
    there = SMALL.project(transform(invert(poses[1]), on_plane(SMALL, poses[0], patch, first.xy))).astype(np.float32)
    second = first.with_columns(xy=there)
    assert repeats(SMALL, poses, patch, (first, second)) == (8, 8)
    assert repeats(SMALL, poses, patch, (first, second.with_columns(xy=there + np.float32(5)))) == (8, 0)
    assert repeats(SMALL, poses, patch, (first, second.with_columns(scale=2 * first.scale))) == (8, 0)
    assert repeats(SMALL, poses, patch, (first, second[np.zeros(8, dtype=bool)])) == (8, 0)


def test_posters_multiply_the_features() -> None:
    setup = replace(CAVE, camera=replace(CAVE.camera, width=568, height=426, fx=553.75, fy=553.75, cx=283.5, cy=212.5))
    dense, bare = (count_features(setup, "dark", has, 500.0, 0) for has in (True, False))
    assert dense.features_per_megapixel > 2 * bare.features_per_megapixel
    assert 0 < dense.repeated <= dense.in_both_views <= dense.features


def test_a_scene_without_dense_posters_is_refused() -> None:
    with pytest.raises(InputError, match="expected posters called dark01"):
        patch_of(load_scene("floor").scene, "dark")
