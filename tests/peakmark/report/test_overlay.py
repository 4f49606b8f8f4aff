"""Drawings: outlines where the array is, circles where the key point is, images untouched, parts inside the image."""

from dataclasses import replace

import numpy as np
import pytest
from peaksim.camera.frame import MarkerTruth
from peaksim.geometry.pose import invert, transform

from peakmark import decode_arrays
from peakmark.found.outline import outline_px
from peakmark.keypoints.keypoints import Keypoints
from peakmark.report.overlay import DARK, LIGHT, MISSED, box_around, draw_arrays, draw_keypoints, draw_overlay
from peakmark.score.markers import score_frame
from tests.peakmark.arrays.arrays_scene import CAMERA, detections, facing_wall, printed_array

IMAGE = np.full((CAMERA.height, CAMERA.width), 120, np.uint8)


@pytest.mark.parametrize("roll", [0, 77, 180])
def test_the_outline_starts_at_the_blank_corner(roll: float) -> None:
    pose = facing_wall(2.0, 0.0, 0.0, roll)
    (array,) = decode_arrays(detections(printed_array(5), pose)[0])
    reach = 0.05 * 1.5
    blank = CAMERA.project(transform(invert(pose), np.array([[-reach, reach, 0.0]])))[0]
    assert np.allclose(outline_px(array)[0], blank, atol=0.5)


def test_marks_are_drawn_on_a_copy() -> None:
    found, _ = detections(printed_array(2), facing_wall(1.0, 10.0, 0.0, 0.0))
    before = IMAGE.copy()
    drawn = draw_arrays(IMAGE, found, decode_arrays(found), [np.array([50.0, 60.0])])
    assert drawn.shape == (*IMAGE.shape, 3)
    assert np.array_equal(IMAGE, before)
    for d in found:
        x, y = np.rint(d.xy).astype(int)
        assert (drawn[y, x] != 120).any()
    assert (drawn[60, 50] != 120).any()


def test_unsure_arrays_have_a_box_around_them() -> None:
    found, _ = detections(printed_array(2), facing_wall(1.0, 10.0, 0.0, 0.0))
    (array,) = decode_arrays(found)
    box = outline_px(replace(array, code=None, doubt="a marker is missing"))
    assert all((box.min(axis=0) < d.xy).all() and (d.xy < box.max(axis=0)).all() for d in found)
    assert np.ptp(box[:, 0]) < 6 * found[0].size


@pytest.mark.parametrize("xy", [[[5.0, 5.0]], [[-50.0, 3.0]], [[1e4, 1e4]], [[100.0, 100.0], [200.0, 140.0]]])
def test_parts_lie_inside_the_image(xy: list[list[float]]) -> None:
    left, top, right, bottom = box_around(np.array(xy), 10, (CAMERA.width, CAMERA.height))
    assert 0 <= left < right <= CAMERA.width
    assert 0 <= top < bottom <= CAMERA.height
    if len(xy) == 2:
        assert (left, top, right, bottom) == (90, 90, 210, 150)


@pytest.mark.parametrize("is_colour", [False, True])
def test_a_missed_marker_is_crossed_out_on_a_copy(is_colour: bool) -> None:
    image = np.repeat(IMAGE[..., None], 3, axis=2) if is_colour else IMAGE.copy()
    corners = np.array([[40.0, 50.0], [60.0, 50.0], [60.0, 70.0], [40.0, 70.0]])
    truth = [MarkerTruth("lost", "surf-dark", corners.mean(axis=0), corners, 20.0, 1.0, 0.0, 1.0)]
    drawn = draw_overlay(image, truth, (), score_frame(truth, (), Keypoints.empty()))
    assert (image == 120).all()
    assert tuple(drawn[60, 50]) == MISSED


def test_key_points_are_circles_of_half_their_size_in_the_colour_of_their_polarity() -> None:
    xy = np.array([[30.0, 40.0], [90.0, 40.0]], np.float32)
    ones = np.ones(2, np.float32)
    keypoints = Keypoints(xy, 24 * ones, -ones, ones, np.zeros(2, np.int32), np.array([1, -1], np.int8), ones)
    drawn = draw_keypoints(IMAGE, keypoints)
    for (x, y), colour in zip(xy.astype(int), (DARK, LIGHT), strict=True):
        assert drawn[y, x + 12].tolist() == pytest.approx(list(colour), abs=25)  # the stroke is smoothed
        assert (drawn[y, x] == 120).all()
