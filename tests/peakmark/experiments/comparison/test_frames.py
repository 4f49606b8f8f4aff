"""Frames: truth is where the prints are, by two ways to draw them; who covers whom; the frames of a run."""

from collections.abc import Callable

import numpy as np
import pytest
from peaksim.traced.library import is_available

from peakmark.experiments.comparison.boards import CAMERA, PITCH, random_board, random_pose, seen_prints
from peakmark.experiments.comparison.comparison import (
    PER_BOARD,
    QUICK,
    RECIPE_POSES,
    ComparisonConfig,
    Frame,
    frames_of,
    readers_of,
    shoot,
)
from peakmark.experiments.comparison.frames import SWEEPS, Shot, View, bare_shot, clean_shot, warped_shot
from peakmark.experiments.comparison.measure import measure
from peakmark.experiments.comparison.prints import DESIGNS, MARGIN
from peakmark.experiments.comparison.readers import READERS
from peakmark.experiments.comparison.recipe import recipe_pose

TAGS = [reader for reader in READERS if reader.name in ("locus AprilTag", "AprilTag-C")]


def test_boards_hold_every_design_and_no_paper_covers_a_print() -> None:
    board = random_board(48, np.random.default_rng(0))
    assert {one.design for one in board} == set(DESIGNS)
    assert (1 + MARGIN) / np.sqrt(2) - 0.1 < PITCH - 0.1  # half diagonals of a print and of the paper beside it
    numbers = [
        (one.design, one.code) for one in board if one.design in ("array", "AprilTag 36h11", "ArUco 4×4", "ring")
    ]
    assert len(numbers) == len(set(numbers))


@pytest.mark.parametrize(("side", "tilt"), [(20, 0), (64, 60)])
def test_the_camera_sees_the_side_and_the_tilt(side: float, tilt: float) -> None:
    rng = np.random.default_rng(1)
    pose = random_pose(side, tilt, rng)
    truth = seen_prints(random_board(side, rng), pose)
    middle = min(truth, key=lambda one: np.linalg.norm(np.array(one.xy) - [CAMERA.cx, CAMERA.cy]))
    assert middle.side_px == pytest.approx(side, rel=0.25)
    assert middle.tilt_deg == pytest.approx(tilt, abs=12)
    assert all(not one.is_whole or (0 < one.xy[0] < 640 and 0 < one.xy[1] < 480) for one in truth)


@pytest.mark.parametrize("shoot_one", [lambda rng: clean_shot(View(tilt_deg=30), rng), warped_shot])
def test_two_ways_to_draw_a_board_agree_with_its_truth(shoot_one: Callable[[np.random.Generator], Shot]) -> None:
    errors, found, all_tags = [], 0, 0
    for seed in range(2):
        outcome = measure(shoot_one(np.random.default_rng(seed)), TAGS[1:])
        errors += [e for r in outcome.readers for e in r.errors_px if e is not None]
        found += sum(e is not None for r in outcome.readers for e in r.errors_px)
        all_tags += sum(len(r.errors_px) for r in outcome.readers)
        assert all(r.false == 0 for r in outcome.readers)
    assert found >= 0.6 * all_tags > 0
    assert np.median(errors) < 0.2


def test_what_is_covered_is_not_found_and_photographs_hold_nothing() -> None:
    covered = measure(clean_shot(View(covered=1.0), np.random.default_rng(0)), TAGS)
    assert not any(e is not None for r in covered.readers for e in r.errors_px)
    bare = measure(bare_shot(np.random.default_rng(0)), TAGS)
    assert [(r.errors_px, r.false, r.pose) for r in bare.readers] == [((), 0, None)] * len(TAGS)


def test_a_run_has_every_value_once_a_board_and_its_frames_are_the_same_each_time() -> None:
    config = ComparisonConfig(frames=2)
    frames = frames_of(config)
    values = sum(map(len, SWEEPS.values()))
    others = 2 * sum(count for name, count in PER_BOARD.items() if name != "traced" or is_available())
    others += 2 * RECIPE_POSES * len(DESIGNS)
    assert len({frame.name for frame in frames}) == len(frames) == 2 * values + others
    assert len(frames_of(QUICK)) < 60 + RECIPE_POSES * len(DESIGNS)
    assert np.array_equal(shoot(config, frames[-2]).gray, shoot(config, frames[-2]).gray)


def test_render_tags_recipe_has_one_print_of_its_size_and_tilt_and_the_same_pose_for_every_design() -> None:
    shots = [shoot(ComparisonConfig(), Frame("render-tag", design, number=3)) for design in ("array", "AprilTag 36h11")]
    assert np.array_equal(shots[0].pose, shots[1].pose)
    assert [one.design for shot in shots for one in shot.truth] == ["array", "AprilTag 36h11"]
    assert shots[0].gray.shape == (1080, 1920)
    poses = [recipe_pose(np.random.default_rng(seed)) for seed in range(400)]
    away = np.array([np.linalg.norm(pose[:3, 3]) for pose in poses])
    sides = 960 / np.tan(np.radians(35)) * 0.06 / away
    assert (sides.min(), sides.max()) == (pytest.approx(40, abs=4), pytest.approx(320, abs=4))
    cosines = np.array([pose[2, 3] for pose in poses]) / away
    assert (cosines.min(), cosines.max()) == (pytest.approx(0.5, abs=0.01), pytest.approx(1, abs=0.01))
    tags = measure(shots[1], TAGS)
    assert all(r.pose is not None and r.pose.position < 0.05 for r in tags.readers)
    assert {reader.name for reader in readers_of(Frame("render-tag", "disc"))} == {"disc by SIFT", "disc by SURF"}
