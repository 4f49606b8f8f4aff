"""Boxes and desks: where their corners are, and that their faces are closed and look outwards."""

import numpy as np
import pytest
from peaksim.scene.build_meshes import build_meshes
from peaksim.scene.scene import Mesh
from peaksim.scene.schema import BoxTable, DeskTable


def volume_m3(mesh: Mesh) -> float:
    """Return the volume that faces enclose, counted from outside (divergence theorem)."""
    return float(np.linalg.det(mesh.triangles_m).sum() / 6)


def test_a_box_stands_on_its_centre_and_its_faces_look_outwards() -> None:
    table = BoxTable(name="crate", size_m=(1.0, 2.0, 3.0), center_m=(4.0, 5.0, 6.0), yaw_deg=90.0, level=70.0)
    (crate,) = build_meshes((table,), ())
    corners = crate.triangles_m.reshape(-1, 3)
    assert corners.min(axis=0) == pytest.approx([3.0, 4.5, 6.0])
    assert corners.max(axis=0) == pytest.approx([5.0, 5.5, 9.0])
    assert volume_m3(crate) == pytest.approx(6.0)
    assert crate.color == (70.0, 70.0, 70.0)
    edges = crate.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert sorted(map(tuple, edges)) == sorted(map(tuple, edges[:, ::-1]))  # closed: each edge once in either direction


def test_a_desk_is_a_top_on_four_legs() -> None:
    table = DeskTable(name="desk", size_m=(2.0, 1.0, 0.8), center_m=(0.0, 0.0, 0.0), leg_m=0.1, top_m=0.05)
    (desk,) = build_meshes((), (table,))
    assert volume_m3(desk) == pytest.approx(2.0 * 1.0 * 0.05 + 4 * 0.1 * 0.1 * 0.75)
    assert np.abs(desk.vertices_m).max(axis=0) == pytest.approx([1.0, 0.5, 0.8])
    assert desk.vertices_m[:, 2].min() == 0
