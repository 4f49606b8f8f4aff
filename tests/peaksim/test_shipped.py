"""Paths that files name stay inside their folder, whatever they are."""

from pathlib import Path

import pytest
from peaksim.errors import SceneError
from peaksim.shipped import file_beside, file_inside, path_inside


@pytest.mark.parametrize("name", ["../../etc/passwd", "/etc/passwd", "a/../../x", "..", "link/x"])
def test_a_path_that_leaves_its_folder_is_refused(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "link").symlink_to("/etc")
    with pytest.raises(SceneError, match=r"^field: expected a path inside in/, got"):
        path_inside(folder, name, "field")


@pytest.mark.parametrize("name", ["a\0b", "x" * 5000, "y/" * 3000])
def test_a_path_that_no_file_can_have_is_one_short_line(tmp_path: Path, name: str) -> None:
    for find in (file_inside, file_beside):
        with pytest.raises(SceneError, match=r"^field: expected a (path|file)") as caught:
            find(tmp_path, name, "field")
        assert len(str(caught.value)) < 250
        assert "\0" not in str(caught.value)


def test_a_file_inside_is_found_also_from_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "x").write_text("1")
    monkeypatch.chdir(tmp_path)
    assert path_inside(Path(), "x", "field") == tmp_path / "x"
    with pytest.raises(SceneError, match=f"expected a path inside {tmp_path.name}/, got '../x'"):
        path_inside(Path(), "../x", "field")
