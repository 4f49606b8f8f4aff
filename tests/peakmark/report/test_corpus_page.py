"""Images of a corpus with its truth drawn in, the page of them, and the recording for Rerun."""

from pathlib import Path

import numpy as np
import pytest
from peaksim.corpus import make_corpus, open_corpus

from peakmark.errors import InputError
from peakmark.report.corpus_page import draw_truth, save_recording, show_frames
from tests.peaksim.corpus.helpers import tiny_spec, write_tiny_scene


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("show")
    make_corpus(tiny_spec(), write_tiny_scene(folder / "specs"), str(folder / "c"))
    return str(folder / "c")


def test_points_are_drawn_where_the_record_has_them(corpus: str) -> None:
    made, drawn = open_corpus(corpus), 0
    for frame in range(len(made)):
        record = made.record(frame)
        image = draw_truth(made.picture(frame), record)
        scale = image.shape[1] // 64
        assert image.shape == (48 * scale, 64 * scale, 3)
        for marker in record["markers"]:
            if marker["points_seen"][0] == 2:
                x, y = (round((value + 0.5) * scale - 0.5) for value in marker["points_xy"][0])
                assert image[y, x].tolist() == [60, 220, 60]
                drawn += 1
    assert drawn >= 12


def test_the_page_has_the_frames_asked_for(corpus: str, tmp_path: Path) -> None:
    page = show_frames(corpus, [3, 7], tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").glob("*.png")) == ["00000003.png", "00000007.png"]
    text = page.read_text()
    assert "Frame 3" in text
    assert "Frame 7" in text
    assert text.count("data:image/jpeg") == 2


def test_without_a_choice_twelve_frames_in_even_steps(corpus: str, tmp_path: Path) -> None:
    show_frames(corpus, None, tmp_path / "out")
    assert len(list((tmp_path / "out").glob("*.png"))) == 12


def test_a_frame_that_is_not_there_is_one_line(corpus: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="12"):
        show_frames(corpus, [12], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_recording_holds_every_frame_with_images_and_points(corpus: str, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    chunk = pytest.importorskip("rerun.chunk", reason="this rerun cannot read recordings")
    frames = [2, 5, 11]
    save_recording(corpus, frames, tmp_path / "new" / "c.rrd")
    rows: dict[str, list[dict[str, object]]] = {}
    for part in chunk.RrdReader(tmp_path / "new" / "c.rrd").stream():
        rows.setdefault(part.entity_path, []).extend(part.to_record_batch().to_pylist())
    records = [open_corpus(corpus).record(frame) for frame in frames]
    assert [row["frame"] for row in rows["/world/markers"]] == frames
    for row, record in zip(rows["/world/markers"], records, strict=True):
        expected = [point for marker in record["markers"] for point in marker["points_world_m"]]
        assert np.allclose(row["Points3D:positions"], expected, atol=1e-6)
    for row, record in zip(rows["/world/camera"], records, strict=True):
        pose = np.array(record["world_from_camera"])
        assert np.allclose(row["Transform3D:translation"], pose[None, :3, 3], atol=1e-6)
        assert np.allclose(row["Transform3D:mat3x3"], pose[:3, :3].T.reshape(1, 9), atol=1e-6)  # column by column
    images = [row for row in rows["/world/camera/picture"] if row.get("Image:buffer") is not None]
    for row, frame in zip(images, frames, strict=True):
        assert bytes(row["Image:buffer"][0]) == open_corpus(corpus).picture(frame).tobytes()  # type: ignore[index]


def test_a_recording_that_cannot_be_written_is_one_line(corpus: str, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"--rrd .*cannot be written: ") as caught:
        save_recording(corpus, [0], tmp_path / "file" / "c.rrd")
    assert "\n" not in str(caught.value)


def test_without_rerun_the_way_to_get_it_is_told(corpus: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "rerun", None)
    with pytest.raises(InputError, match=r"--rrd: needs rerun: pip install 'peakmark\[rerun\]'"):
        save_recording(corpus, [0], tmp_path / "c.rrd")
