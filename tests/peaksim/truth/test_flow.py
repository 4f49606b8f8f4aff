"""Optical flow against the known motion of points, and what is hidden."""

from dataclasses import replace

import numpy as np
from peaksim import Camera, Quad, Scene, Trajectory, optical_flow, render
from peaksim.geometry.pose import compose
from peaksim.truth.flow import surface_points

from tests.peaksim.shapes import plain_texture

CAMERA = Camera(width=48, height=36, fx=40.0, fy=40.0, cx=23.5, cy=17.5)
GREY = plain_texture(90)
FLOOR = Quad("floor", GREY, (4.0, 4.0), np.eye(4))
CARD = Quad("card", GREY, (0.3, 0.3), compose(np.eye(3), [0, 0, 0.5]))


def above(x_m: float, z_m: float = 1.0) -> np.ndarray:
    return compose(np.diag([1.0, -1.0, -1.0]), [x_m, 0, z_m])


def test_a_plane_moves_evenly_and_a_nearer_card_twice_as_far() -> None:
    scene = Scene((FLOOR, CARD))
    first, second = (render(scene, CAMERA, above(x), renderer="exact") for x in (0.0, 0.1))
    flow = optical_flow(scene, first, second)
    assert np.allclose(flow.xy[first.quad_ids == 0], [-4, 0], atol=1e-4)
    assert np.allclose(flow.xy[first.quad_ids == 1], [-8, 0], atol=1e-4)
    assert flow.visible[first.quad_ids == 1].all()
    # the card, 24 px wide, hides 4 columns of floor left of it; 4 others leave the image
    hidden = ~flow.visible[18] & (first.quad_ids[18] == 0)
    assert np.flatnonzero(hidden).tolist() == [0, 1, 2, 3, 8, 9, 10, 11]


def test_where_nothing_is_there_is_no_flow() -> None:
    scene = Scene((CARD,))
    frame = render(scene, CAMERA, above(0), renderer="exact")
    flow = optical_flow(scene, frame, frame)
    assert np.array_equal(np.isnan(flow.xy[..., 0]), frame.quad_ids < 0)
    assert np.array_equal(flow.visible, frame.quad_ids == 0)
    assert np.abs(flow.xy[flow.visible]).max() < 1e-4


def test_a_rolling_shutters_points_are_those_it_shows() -> None:
    scene = Scene((FLOOR, CARD))
    trajectory = Trajectory(np.array([-1.0, 1.0]), np.stack([above(-1.0), above(1.0)]))
    frame = render(scene, replace(CAMERA, row_time_s=1e-3), trajectory, renderer="exact")
    points = surface_points(frame)
    assert np.allclose(points[:, 2], np.where(frame.quad_ids.ravel() == 1, 0.5, 0.0), atol=1e-6)
    flow = optical_flow(scene, frame, frame)
    assert np.abs(flow.xy).max() < 1e-4
    assert frame.normals[18, 24].tolist() == [0, 0, -1]
    assert (frame.mesh_ids == -1).all()
