"""Maps from sheets, scenes and TOML files agree with what was printed; what is none of them is one line."""

import json
from pathlib import Path

import numpy as np
import pytest
from peaksim import load_scene

from peakmark.cli.marker import result, sheet_tiles
from peakmark.errors import InputError
from peakmark.maps.files import load_map, save_map, scene_map
from peakmark.maps.marker_map import MarkerMap
from peakmark.markers.board import BOARD_LAYOUT, board_page
from peakmark.markers.sheet import pages, paper_size
from peakmark.score.arrays import printed_arrays


def write_sheet(folder: Path, kind: str, side_mm: float, gap_mm: float | None = None, count: int = 1) -> Path:
    tiles = sheet_tiles(kind, side_mm, "dark", "energy", gap_mm, count)
    path = folder / "result.json"
    path.write_text(json.dumps(result(pages(tiles, paper_size("a4")), ["sheet.pdf"])), encoding="utf-8")
    return path


def test_a_sheet_is_a_map_of_its_pages(tmp_path: Path) -> None:
    printed = load_map(write_sheet(tmp_path, "array", 40.0))
    assert [array.code for array in printed.arrays] == list(range(8))
    assert len(printed) == 24
    for code, place in printed.places.items():
        right, up = place.centers_m[2] - place.centers_m[1], place.centers_m[0] - place.centers_m[2]
        assert np.allclose([right, up], [[0.06, 0, 0], [0, 0.06, 0]])
        (array,) = (each for each in printed.arrays if each.code == code)
        assert code == sum((printed.polarities[r] == "light") << (2 - k) for k, r in enumerate(array.rows))
    first = printed.pieces[0]
    assert np.abs(first.centers_m).max() < 0.297 / 2
    assert first.centers_m[0, 1] > first.centers_m[1, 1]  # y is up the page
    assert sum(len(piece) for piece in printed.pieces) == 24
    assert len(load_map(tmp_path)) == 24  # the folder of the sheet


def test_a_sheet_of_single_markers_has_no_arrays(tmp_path: Path) -> None:
    printed = load_map(write_sheet(tmp_path, "surf", 40.0, count=6))
    assert (len(printed), printed.arrays, set(printed.polarities)) == (6, (), {"dark"})


def test_a_stated_gap_is_the_layouts_pitch(tmp_path: Path) -> None:
    assert load_map(write_sheet(tmp_path, "array", 30.0, 6.0)).layout.pitch == pytest.approx(1.2)


def test_a_print_that_came_out_smaller_scales_the_map(tmp_path: Path) -> None:
    path = write_sheet(tmp_path, "array", 40.0)
    right, smaller = load_map(path), load_map(path, scale_bar_mm=97.0)
    assert np.allclose(smaller.centers_m, 0.97 * right.centers_m)
    assert np.allclose(smaller.sides_m, 0.0388)


def test_a_scene_is_a_map_of_its_prints() -> None:
    scene = load_scene("cave").scene
    found = load_map("cave")
    for array in printed_arrays(scene):
        assert np.allclose(found.places[array.code].centers_m, array.place.centers_m)
        assert np.allclose(found.places[array.code].axes, array.place.axes)
    hall = load_map("hall")
    assert len(hall) == 44
    assert np.ptp(hall.centers_m[:, 2]) == 0


def assert_same(a: MarkerMap, b: MarkerMap, tolerance_m: float) -> None:
    assert np.allclose(a.centers_m, b.centers_m, rtol=0, atol=tolerance_m)
    assert np.allclose(a.axes, b.axes, atol=1e-8)
    assert np.allclose(a.sides_m, b.sides_m)
    assert (a.polarities, a.arrays) == (b.polarities, b.arrays)


def test_what_is_saved_is_loaded(tmp_path: Path) -> None:
    sheet = load_map(write_sheet(tmp_path, "array-5", 40.0))
    arrays_alone = load_map("cave")[np.array(sorted(r for each in load_map("cave").arrays for r in each.rows))]
    for marker_map, tolerance_m in ((sheet, 1e-9), (load_map("hall"), 1e-7), (arrays_alone, 2e-4)):
        save_map(marker_map, tmp_path / "map.toml")  # a scene's texels round the cells of its arrays
        assert_same(load_map(tmp_path / "map.toml"), marker_map, tolerance_m)


def test_a_board_is_one_map_of_its_own_layout(tmp_path: Path) -> None:
    page, count = board_page(paper_size("a3"))
    (tmp_path / "board").mkdir()
    text = json.dumps(result((page,), ["board.pdf"], BOARD_LAYOUT))
    (tmp_path / "board" / "result.json").write_text(text, encoding="utf-8")
    board = load_map(tmp_path / "board")
    assert [array.code for array in board.arrays] == list(range(count))
    assert (count, len(board), board.layout) == (20, 160, BOARD_LAYOUT)
    save_map(board, tmp_path / "map.toml")
    assert_same(load_map(tmp_path / "map.toml"), board, 1e-9)
    assert load_map(tmp_path / "map.toml").layout == BOARD_LAYOUT


def test_a_map_of_several_sheets_cannot_be_saved(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a map of one piece, got one of several sheets"):
        save_map(load_map(write_sheet(tmp_path, "array", 40.0)), tmp_path / "map.toml")


TOML = """
[[arrays]]
code = 5
side_m = 0.1
center_m = [0.0, 2.0, 1.5]
normal = [0.0, -1.0, 0.0]

[[markers]]
polarity = "dark"
side_m = 0.08
center_m = [1.0, 0.0, 0.0]
"""


def test_a_map_by_hand(tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text(TOML, encoding="utf-8")
    found = load_map(tmp_path / "map.toml")
    centers = [[0.075, 2, 1.575], [-0.075, 2, 1.425], [0.075, 2, 1.425], [1, 0, 0]]
    assert np.allclose(found.centers_m, centers)  # seen from y < 0: right is +x
    assert found.polarities == ("light", "dark", "light", "dark")
    assert np.allclose(found.axes[0], [[1, 0], [0, 0], [0, -1]])


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("m.toml", "", "expected [[arrays]] or [[markers]], got none"),
        ("m.toml", TOML.replace("0.1", "100.0"), "is it in millimetres?"),
        ("m.toml", TOML.replace("[1.0, 0.0", "[1100.0, 0.0"), "is it in millimetres?"),
        ("m.toml", TOML.replace("code = 5", "code = 9"), "arrays[0].code: expected an integer in 0…7, got 9"),
        ("m.toml", TOML.replace("side_m = 0.1", "size_m = 0.1"), "unknown field (did you mean 'side_m'?)"),
        ("m.toml", TOML.replace("[0.0, -1.0, 0.0]", "[0.0, 0.0, 1.0]"), "arrays[0]: expected normal and up"),
        ("m.toml", "[[", "is not TOML"),
        ("m.json", "{}", "expected the result.json of `peakmark marker`, got one without markers"),
        ("m.json", "[1]", "expected the result.json of a sheet"),
        ("m.json", '{"markers": [{"page": 1}]}', "expected the result.json of a sheet"),
        ("m.json", "{", "expected the result.json of a sheet"),
    ],
)
def test_what_is_no_map_is_one_line(tmp_path: Path, name: str, text: str, words: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_map(tmp_path / name)
    assert words in str(error.value)
    assert str(tmp_path / name) in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_a_scale_bar_needs_a_sheet_and_a_scene_needs_markers(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--scale-bar-mm 97: expected with a sheet's result\.json alone"):
        load_map("cave", scale_bar_mm=97)
    with pytest.raises(InputError, match=r"970: expected what the sheet.s bar of 100 mm measures, 50…200 mm"):
        load_map(write_sheet(tmp_path, "array", 40.0), scale_bar_mm=970)
    with pytest.raises(InputError, match=r"none\.toml: cannot be read: No such file"):
        load_map(tmp_path / "none.toml")
    scene = load_scene("cave").scene
    bare = type(scene)(tuple(quad for quad in scene.quads if not quad.marks))
    with pytest.raises(InputError, match="expected a scene with SURF markers, got none"):
        scene_map(bare)
