"""Input files: bytes other than those that corpus.json lists make no frame, whenever and wherever they differ."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from peaksim.corpus import in_process, make_corpus, open_corpus, processes
from peaksim.corpus import write as corpus_write
from peaksim.corpus.configuration import make_configuration
from peaksim.corpus.inputs import input_files
from peaksim.corpus.make import Job
from peaksim.corpus.plan import FramePlan, open_sequence, plan_frame
from peaksim.corpus.write import write_part, write_shard
from peaksim.errors import InputError, SceneError
from peaksim.shipped import ASSETS, SCENES

from tests.peaksim.corpus.helpers import SCENE, contents, tiny_spec, write_tiny_scene

OTHERS = r"plain\.png: expected the bytes that the corpus was begun with, found others"


def paint(folder: Path, level: int) -> None:
    """Replace the floor's photograph."""
    cv2.imwrite(str(folder / "plain.png"), np.full((8, 8), level, np.uint8))


def job_of(dest: Path, folder: Path) -> Job:
    from hashlib import sha256

    return Job(str(dest), str(folder), sha256((dest / "corpus.json").read_bytes()).hexdigest())


@pytest.mark.parametrize("backend", [in_process(), processes(1)], ids=["in process", "processes"])
def test_a_texture_that_changes_while_a_run_lasts_stops_it_and_its_bytes_count_nowhere(
    folder: Path, tmp_path: Path, backend: object
) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "whole"))
    seen: list[int] = []

    def repaint(frames: int) -> None:
        seen.append(frames)
        if sum(seen) == 3:
            paint(folder, 40)

    with pytest.raises(InputError, match=OTHERS) as caught:
        make_corpus(tiny_spec(), folder, str(tmp_path / "c"), backend, repaint)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match=r"another configuration: inputs\.plain\.png is"):
        make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    paint(folder, 150)
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    assert contents(tmp_path / "c") == contents(tmp_path / "whole")


def test_no_frame_is_written_of_a_texture_that_changed_in_the_middle_of_a_shard(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frame 4 begins a sequence, so its textures are read anew; what is wrong must not be there for the next run."""
    spec = tiny_spec(store={"shard_frames": 12, "part_frames": 12})
    make_corpus(spec, folder, str(tmp_path / "whole"))

    def repaint_and_plan(spec: object, folder: Path, index: int) -> FramePlan:
        if index == 4:
            paint(folder, 40)
        return plan_frame(spec, folder, index)  # type: ignore[arg-type]

    monkeypatch.setattr(corpus_write, "plan_frame", repaint_and_plan)
    with pytest.raises(InputError, match=OTHERS):
        make_corpus(spec, folder, str(tmp_path / "c"))
    monkeypatch.undo()
    assert len(list((tmp_path / "c").glob("frames/*/*.png"))) == 4
    paint(folder, 150)
    assert make_corpus(spec, folder, str(tmp_path / "c")).rendered == 8
    assert contents(tmp_path / "c") == contents(tmp_path / "whole")


def test_a_file_that_is_written_again_with_its_own_bytes_stops_nothing(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "whole"))
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"), on_frames=lambda frames: paint(folder, 150))
    assert contents(tmp_path / "c") == contents(tmp_path / "whole")


@pytest.mark.parametrize("work", [write_shard, write_part])
@pytest.mark.parametrize("change", ["other bytes", "missing", "another scene"])
def test_a_worker_whose_files_differ_refuses(folder: Path, tmp_path: Path, work: object, change: str) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    shutil.rmtree(tmp_path / "c" / "sums")
    elsewhere = write_tiny_scene(tmp_path / "elsewhere")
    if change == "other bytes":
        paint(elsewhere, 40)
    elif change == "missing":
        (elsewhere / "striped.png").unlink()
    else:
        (elsewhere / "tiny.toml").write_text(SCENE.replace("level = 200", "level = 201"))
    words = {"other bytes": OTHERS, "missing": r"textures\.floor: expected a file", "another scene": r"tiny\.toml: exp"}
    with pytest.raises(InputError, match=words[change]):
        work(job_of(tmp_path / "c", elsewhere), 0)  # type: ignore[operator]
    assert not (tmp_path / "c" / "sums").exists()


def test_a_second_corpus_in_one_process_shows_the_files_as_they_are_now(folder: Path, tmp_path: Path) -> None:
    """Sequences are cached by specification, folder and number, which say nothing about the files' bytes."""
    spec = tiny_spec(frames=4, textures={"floor": {"variants": ["plain"]}})
    make_corpus(spec, folder, str(tmp_path / "light"))
    paint(folder, 40)
    make_corpus(spec, folder, str(tmp_path / "dark"))
    open_sequence.cache_clear()
    make_corpus(spec, folder, str(tmp_path / "fresh"))
    assert contents(tmp_path / "dark") == contents(tmp_path / "fresh")
    darker = [open_corpus(str(tmp_path / name)).picture(0).mean() for name in ("dark", "light")]
    assert darker[0] < darker[1] - 10


def test_every_file_is_listed_also_textures_of_one_name_in_two_folders(folder: Path) -> None:
    write_tiny_scene(folder / "sub")
    paint(folder / "sub", 40)
    spec = tiny_spec(scenes=[{"file": "tiny.toml"}, {"file": "sub/tiny.toml"}, {"file": "floor"}])
    files = input_files(spec, folder, ("surf-dark",))
    beside = {f"{sub}{name}" for sub in ("", "sub/") for name in ("tiny.toml", "plain.png", "striped.png")}
    assert {name: files[name] for name in beside} == {name: folder / name for name in beside}
    assert files["floor"] == SCENES / "floor.toml"
    assert files["textures/brick.png"] == ASSETS / "textures/brick.png"
    assert files["markers/surf-dark.png"] == ASSETS / "markers/surf-dark.png"
    assert len(files) == len(beside) + 2 + len([name for name in files if name.startswith("textures/")])


def test_a_texture_named_as_a_shipped_marker_is_listed_beside_it(folder: Path) -> None:
    (folder / "markers").mkdir()
    shutil.copy(folder / "plain.png", folder / "markers" / "surf-dark.png")
    (folder / "tiny.toml").write_text(SCENE.replace('"plain.png"', '"markers/surf-dark.png"'))
    files = input_files(tiny_spec(), folder, ("surf-dark",))
    assert files["markers/surf-dark.png"] == folder / "markers/surf-dark.png"
    assert files["assets/markers/surf-dark.png"] == ASSETS / "markers/surf-dark.png"


@pytest.mark.parametrize("file", ["../../etc/passwd", "nowhere.png"])
def test_a_variant_that_no_frame_shows_is_read_no_more_freely_than_others(folder: Path, file: str) -> None:
    (folder / "tiny.toml").write_text(SCENE.replace('"striped.png"', f'"{file}"'))
    with pytest.raises(SceneError, match=r"tiny\.toml: textures\.floor: expected a (path|file)"):
        make_configuration(tiny_spec(), folder, "exact", None)
