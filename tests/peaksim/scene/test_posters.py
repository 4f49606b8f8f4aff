"""Posters: every marker's texels are the shipped pattern's, exactly where truth says; faulty tables are refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peaksim import load_scene, shipped
from peaksim.errors import SceneError
from peaksim.image_file import read_image
from peaksim.scene.posters import poster_copies, print_poster
from peaksim.scene.schema import PosterTable
from pydantic import ValidationError


def table(**changes: Any) -> PosterTable:
    fields = {
        "name": "p",
        "rows": (".D", "LD"),
        "side_m": 0.05,
        "pitch_m": 0.08,
        "center_m": (0.0, 0.0, 1.0),
        "normal": (0.0, -1.0, 0.0),
        "paper_m": (0.2, 0.3),
        **changes,
    }
    return PosterTable(**fields)


@pytest.mark.parametrize(
    ("side_m", "pitch_m", "dark", "light"),
    [
        (0.05, 0.08, "surf-dark", "surf-light"),
        (0.0333, 0.0501, "sift-dark", "sift-light"),
        (0.061, 0.061, "surf-range-dark", "sift-range-light"),
    ],
)
def test_patterns_lie_where_the_marks_say(side_m: float, pitch_m: float, dark: str, light: str) -> None:
    texture, size_m, marks = print_poster(table(side_m=side_m, pitch_m=pitch_m, kinds={"D": dark, "L": light}), "p")
    texel_m = side_m / 144
    assert [m.name for m in marks] == ["r0c1", "r1c0", "r1c1"]
    assert [m.kind for m in marks] == [dark, light, dark]
    assert np.allclose(size_m, np.array(texture.size) * texel_m, rtol=1e-12)
    assert np.abs(np.array(size_m) - [0.2, 0.3]).max() <= texel_m / 2
    rest = texture.pixels.copy()
    for mark in marks:
        left, top = (mark.center_m[0] + size_m[0] / 2) / texel_m - 72, (size_m[1] / 2 - mark.center_m[1]) / texel_m - 72
        column, row = round(left), round(top)
        assert abs(left - column) < 1e-6
        assert abs(top - row) < 1e-6
        pattern = read_image(shipped.ASSETS / "markers" / f"{mark.kind}.png")
        assert np.array_equal(rest[row : row + 144, column : column + 144], pattern)
        rest[row : row + 144, column : column + 144] = 255
    assert (rest == 255).all()
    centers = np.array([m.center_m for m in marks])
    assert np.abs(centers - np.array([[1, 1], [-1, -1], [1, -1]]) * pitch_m / 2).max() <= texel_m


def test_copies_hang_side_by_side_on_one_texture() -> None:
    quads = list(poster_copies(table(copies=(3, 2), step_m=(0.3, 0.4), normal=(0, 0, 1), up=(0, 1, 0)), "p"))
    assert [q.name for q in quads] == [f"p{k:02d}" for k in range(1, 7)]
    positions = [q.world_from_quad[:3, 3] for q in quads]
    assert np.allclose(positions, [(x, y, 1.0) for y in (0.2, -0.2) for x in (-0.3, 0, 0.3)])
    assert len({id(q.texture) for q in quads}) == 1
    assert quads[4].marks[2].name == "p05.r1c1"
    assert len({m.name for q in quads for m in q.marks}) == 18


def test_a_turned_poster_turns_about_its_middle() -> None:
    (straight,), (rotated,) = poster_copies(table(), "p"), poster_copies(table(turn_deg=90), "p")
    assert np.allclose(straight.world_from_quad[:3, 3], rotated.world_from_quad[:3, 3])
    assert np.allclose(rotated.world_from_quad[:3, 0], straight.world_from_quad[:3, 1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rows": (".D", "LX")}, "expected rows of equal length with the letters"),
        ({"rows": (".D", "L")}, "expected rows of equal length"),
        ({"rows": ()}, "at least 1 item"),
        ({"pitch_m": 0.04}, "expected pitch_m of at least side_m"),
        ({"paper_m": (0.1, 0.3)}, r"expected paper_m of at least 0\.13×0\.13 m"),
        ({"copies": (0, 1)}, "greater than or equal to 1"),
    ],
)
def test_faulty_tables(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        table(**changes)


def test_faulty_patterns_and_sizes() -> None:
    with pytest.raises(SceneError, match=r"posters\[0\]\.kinds\.D: expected one of .*surf-dark.*, got 'none'"):
        print_poster(table(kinds={"D": "none", "L": "surf-light"}), "posters[0]")
    with pytest.raises(SceneError, match=r"p\.paper_m: expected at most 64000000 texels"):
        print_poster(table(paper_m=(50.0, 50.0), side_m=0.01), "p")


def test_posters_outside_the_room_are_refused(tmp_path: Path) -> None:
    cave = (shipped.SCENES / "cave.toml").read_text(encoding="utf-8")
    (tmp_path / "far.toml").write_text(cave.replace("[-0.4, 4.998, 1.45]", "[-0.4, 5.2, 1.45]"), encoding="utf-8")
    with pytest.raises(SceneError, match=r"far\.toml: posters\[1\]\.center_m: expected markers inside the room"):
        load_scene(tmp_path / "far.toml")


def test_the_cave_holds_all_eight_arrays_and_three_dense_walls() -> None:
    quads = {q.name: q for q in load_scene("cave").scene.quads}
    for code in range(8):
        kinds = [m.kind for m in quads[f"array{code}"].marks]
        assert [k == "surf-light" for k in kinds] == [bool(code >> bit & 1) for bit in (2, 1, 0)]
    assert sum(len(q.marks) for q in quads.values()) == 8 * 3 + 3 * 24 * 48
