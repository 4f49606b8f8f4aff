"""Paper put on surfaces: where it is, which way up, and that it is seen."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from peaksim import Bend, Scene, load_scene, render
from peaksim.errors import SceneError
from peaksim.geometry.pose import look_at
from peaksim.scene.placing import marker, put_on, sheet
from PIL import Image

from tests.peaksim.scene.boxes import cube
from tests.peaksim.scene.test_own_prints import SHEET
from tests.peaksim.shapes import plain_quad
from tests.peaksim.truth.test_bent import CAMERA


def test_a_marker_on_the_wall_of_a_room_is_seen_upright() -> None:
    setup = load_scene("cave")
    scene = put_on(setup.scene, marker("surf-dark", 0.12, name="new"), "wall_y_max", (0.4, 0.9))
    paper = scene.quads[-1]
    wall = next(quad for quad in scene.quads if quad.name == "wall_y_max")
    assert np.allclose(paper.world_from_quad[:3, :3], wall.world_from_quad[:3, :3])
    assert np.allclose(paper.world_from_quad[:3, :3] @ [0, 1, 0], [0, 0, 1])
    assert np.linalg.inv(wall.world_from_quad)[:3] @ [*paper.world_from_quad[:3, 3], 1] == pytest.approx(
        [0.4, 0.9, 1e-3]
    )
    middle = paper.world_from_quad[:3, 3]
    frame = render(scene, CAMERA, look_at(middle + 0.5 * paper.world_from_quad[:3, 2], middle), "exact")
    (truth,) = [record for record in frame.truth if record.name == "new"]
    assert truth.visible_fraction == 1.0
    assert truth.affinity[0, 0] > 0  # right is right, and down is down
    assert truth.affinity[1, 1] > 0


@pytest.mark.parametrize(
    ("facing", "middle", "up"),
    [
        ((0, 0, 1), (0.1, 0.05, 1.001), (0, 1, 0)),
        ((0, -2, 0), (0.1, -0.501, 0.55), (0, 0, 1)),
        ((1, 0, 0), (0.501, 0.1, 0.55), (0, 0, 1)),
    ],
)
def test_paper_lies_on_the_side_of_a_box(
    facing: tuple[float, float, float], middle: tuple[float, ...], up: tuple[float, ...]
) -> None:
    scene = put_on(
        Scene((), (cube(1.0),)), marker("surf-light", 0.1, border_m=0.02), "cube", (0.1, 0.05), facing=facing
    )
    pose = scene.quads[-1].world_from_quad
    assert np.allclose(pose[:3, 3], middle)
    assert np.allclose(pose[:3, 1], up)
    assert np.allclose(pose[:3, 2] * np.linalg.norm(facing), facing)
    assert scene.quads[-1].size_m[0] == pytest.approx(0.14, abs=2 * 0.1 / 144)


def test_a_sheet_is_turned_and_bent(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text(json.dumps(SHEET))
    floor = Scene((plain_quad("floor", 90, 2.0, np.eye(4)),))
    paper = sheet(tmp_path, name="s", bend=Bend(0.2))
    scene = put_on(floor, paper, "floor", turn_deg=90)
    assert np.allclose(scene.quads[-1].world_from_quad[:3, 0], [0, 1, 0])
    assert [mark.name for mark in scene.quads[-1].marks] == ["s.m1", "s.m2"]
    assert scene.quads[-1].bend == Bend(0.2)


def test_an_image_file_is_a_marker_and_paper_on_bent_paper_touches_it(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((20, 20), np.uint8)).save(tmp_path / "own.png")
    pillar = replace(plain_quad("pillar", 90, 0.6, np.eye(4)), bend=Bend(0.1))
    scene = put_on(Scene((pillar,)), marker(tmp_path / "own.png", 0.02), "pillar", (0.1 * np.pi / 2, 0.1))
    assert scene.quads[-1].name == "own"
    assert np.allclose(scene.quads[-1].world_from_quad[:3, 3], [0.101, 0.1, -0.1])
    assert np.allclose(scene.quads[-1].world_from_quad[:3, 2], [1, 0, 0])


def test_what_is_not_there_is_one_line() -> None:
    scene, paper = Scene((plain_quad("floor", 90, 2.0, np.eye(4)),), (cube(1.0),)), marker("surf-dark", 0.1)
    with pytest.raises(SceneError, match="on: expected one of floor, cube, got 'wall'"):
        put_on(scene, paper, "wall")
    for facing in ((1.0, 1.0, 0.0), (0.0, 0.0, 0.0), (np.nan, 0.0, 0.0)):
        with pytest.raises(SceneError, match="'cube' has none"):
            put_on(scene, paper, "cube", facing=facing)
    with pytest.raises(SceneError, match="gap_m ≥ 0"):
        put_on(scene, paper, "floor", gap_m=-1.0)
    with pytest.raises(SceneError, match=r"kind: expected one of .*surf-dark"):
        marker("none", 0.1)
    with pytest.raises(SceneError, match="side_m > 0"):
        marker("surf-dark", 0.0)
