"""make_corpus: the same bytes however it is made, also after kill -9, full disks and damage; what is foreign stays."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from peaksim.corpus import check_corpus, in_process, make_corpus, open_corpus, processes
from peaksim.corpus.write import Job, write_shard
from peaksim.errors import InputError, SceneError

from tests.peaksim.corpus.helpers import (
    child_environment,
    complaints,
    contents,
    is_alive,
    run_make,
    tiny_spec,
    wait_until,
)


def test_the_tree_is_as_documented_and_checks(folder: Path, tmp_path: Path) -> None:
    counts: list[int] = []
    made = make_corpus(tiny_spec(), folder, str(tmp_path / "c"), in_process(), counts.append)
    assert (made.frames, made.rendered, made.configuration.renderer) == (12, 12, "exact")
    assert counts == [0, 3, 3, 3, 3]
    names = set(contents(tmp_path / "c"))
    tables = (
        "frames.parquet",
        "markers.parquet",
        "coco_keypoints.json",
        "poses_tum.txt",
        "colmap/cameras.txt",
        "colmap/images.txt",
        "colmap/points3D.txt",
    )
    assert names == {
        "corpus.json",
        "manifest.json",
        "cameras/cam.yaml",
        *(f"frames/{i // 3:06d}/{i:08d}.{end}" for i in range(12) for end in ("png", "json")),
        *(f"shards/{shard:06d}.tar" for shard in range(4)),
        *(f"records/{shard:06d}.jsonl" for shard in range(4)),
        *(f"sums/shard-{shard:06d}.sha256" for shard in range(4)),
        *(f"tables/{part:06d}/{name}" for part in range(2) for name in tables),
        *(f"sums/part-{part:06d}.sha256" for part in range(2)),
    }
    assert check_corpus(str(tmp_path / "c")) == []


def test_sha256sum_agrees_with_the_lists(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    for sums in (tmp_path / "c" / "sums").iterdir():
        done = subprocess.run(["sha256sum", "--check", "--strict", sums], cwd=tmp_path / "c", timeout=60)
        assert done.returncode == 0


def test_a_finished_corpus_is_left_alone(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "c").rglob("*")}
    assert make_corpus(tiny_spec(), folder, str(tmp_path / "c")).rendered == 0
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "c").rglob("*")} == before


def test_two_processes_make_the_same_bytes_as_one(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "one"))
    assert make_corpus(tiny_spec(), folder, str(tmp_path / "two"), processes(2)).rendered == 12
    assert contents(tmp_path / "two") == contents(tmp_path / "one")


@pytest.mark.parametrize("store", [{"files": False}, {"shards": False}], ids=str)
def test_frames_can_lie_loose_only_or_in_shards_only(folder: Path, tmp_path: Path, store: dict[str, bool]) -> None:
    spec = tiny_spec(store={"shard_frames": 3, "part_frames": 6, **store})
    make_corpus(spec, folder, str(tmp_path / "c"))
    names = contents(tmp_path / "c")
    assert any(name.startswith("frames/") for name in names) == spec.store.files
    assert any(name.startswith("shards/") for name in names) == spec.store.shards
    assert check_corpus(str(tmp_path / "c")) == []


@pytest.mark.parametrize("seed", range(2))
def test_whatever_is_lost_or_torn_is_made_again(folder: Path, tmp_path: Path, seed: int) -> None:
    """Take back a random part of a finished set in the order of writing, tear some files, and go on."""
    make_corpus(tiny_spec(), folder, str(tmp_path / "whole"))
    make_corpus(tiny_spec(), folder, str(tmp_path / "torn"))
    rng = random.Random(seed)
    (tmp_path / "torn" / "manifest.json").unlink()
    for sums in sorted((tmp_path / "torn" / "sums").iterdir()):
        if rng.random() < 0.7 or "part" in sums.name:
            sums.unlink()
    unsealed = [shard for shard in range(4) if not (tmp_path / "torn" / "sums" / f"shard-{shard:06d}.sha256").exists()]
    for shard in unsealed:
        for path in sorted((tmp_path / "torn" / "frames" / f"{shard:06d}").iterdir()):
            fate = rng.random()
            if fate < 0.3:
                path.unlink()
            elif fate < 0.5:
                path.write_bytes(path.read_bytes()[: rng.randrange(20)])
        (tmp_path / "torn" / "shards" / f"{shard:06d}.tar").write_bytes(b"torn")
    make_corpus(tiny_spec(), folder, str(tmp_path / "torn"))
    assert contents(tmp_path / "torn") == contents(tmp_path / "whole")


@pytest.mark.parametrize(
    "name",
    [
        "shards/000001.tar",
        "records/000001.jsonl",
        "frames/000001/00000004.png",
        "frames/000001/00000004.json",
        "sums/shard-000001.sha256",
        "tables/000000/frames.parquet",
        "sums/part-000000.sha256",
    ],
)
def test_what_rotted_in_a_finished_shard_or_part_is_said_and_made_again(
    folder: Path, tmp_path: Path, name: str
) -> None:
    """A digit of the record is changed so that it stays a record: only its check sum tells."""
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    whole = contents(tmp_path / "c")
    (tmp_path / "c" / "manifest.json").unlink()
    content = bytearray(whole[name])
    at = whole[name].rindex(b"0.") + 2 if name.endswith((".json", ".jsonl")) else len(content) // 2
    content[at] ^= 1
    (tmp_path / "c" / name).write_bytes(content)
    made = make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    assert made.damaged
    assert all(repr(name) in line or name.startswith("sums/") for line in made.damaged)
    assert contents(tmp_path / "c") == whole
    assert make_corpus(tiny_spec(), folder, str(tmp_path / "c")).damaged == ()


def kill_until_done(folder: Path, dest: Path, kills: int, rng: random.Random, *, frames: int) -> int:
    """Run with two workers again and again, killing the process group after a random time; return how many kills."""
    spec = tiny_spec(frames=frames)
    for killed in range(kills):
        process = run_make(spec, folder, dest, "2")
        try:
            status = process.wait(rng.uniform(1.0, 7.0))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait(10)
            continue
        assert status == 0, complaints(dest).read_text()
        return killed
    assert wait_or_kill(run_make(spec, folder, dest, "2"), 240 + frames) == 0, complaints(dest).read_text()
    return kills


def wait_or_kill(process: subprocess.Popen[bytes], limit_s: float) -> int:
    """Return a process's status; one that takes too long ends with its group, by SIGKILL."""
    try:
        return process.wait(limit_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return process.wait(10)


def test_kill_9_while_it_runs_changes_nothing_in_the_end(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(frames=60), folder, str(tmp_path / "whole"))
    kill_until_done(folder, tmp_path / "killed", 1, random.Random(1), frames=60)
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")
    assert check_corpus(str(tmp_path / "killed")) == []


@pytest.mark.slow
def test_20_random_kills_over_500_frames_leave_every_byte_as_it_would_be(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(frames=500), folder, str(tmp_path / "whole"))
    killed = kill_until_done(folder, tmp_path / "killed", 20, random.Random(2), frames=500)
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")
    print(f"{killed} kills")


@pytest.mark.parametrize("moment", ["while it starts its workers", "in the middle"])
def test_workers_do_not_outlive_a_killed_run(folder: Path, tmp_path: Path, moment: str) -> None:
    process = run_make(tiny_spec(frames=4000), folder, tmp_path / "c", "2")
    try:
        if moment == "in the middle":
            wait_until(lambda: any((tmp_path / "c").glob("frames/*/*.png")))
        wait_until(lambda: len(children_of(process.pid)) >= 2)
        children = children_of(process.pid)
        os.kill(process.pid, signal.SIGKILL)  # the parent alone
        process.wait(10)
        wait_until(lambda: not any(is_alive(pid) for pid in children))
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def children_of(pid: int) -> list[int]:
    """Return the processes that a running process has started."""
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": 6}, r"spec\.seed is 5 there and 6 here"),
        ({"sensor": {"read_noise": [0, 3]}}, r"spec\.sensor\.read_noise\.uniform\.1 is 2\.0 there and 3\.0 here"),
        ({"light": {"ambient": 1}}, r"spec\.light\.per is None there and 'frame' here"),
        ({"frames": 13}, r"spec\.frames is 12 there and 13 here"),
    ],
    ids=str,
)
def test_a_corpus_of_another_configuration_is_refused_with_the_field(
    folder: Path, tmp_path: Path, change: dict[str, object], words: str
) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    before = contents(tmp_path / "c")
    with pytest.raises(InputError, match=f"another configuration: {words}"):
        make_corpus(tiny_spec(**change), folder, str(tmp_path / "c"))
    assert contents(tmp_path / "c") == before


def test_a_scene_or_texture_that_changed_since_is_refused(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    (folder / "tiny.toml").write_text((folder / "tiny.toml").read_text().replace("level = 200", "level = 201"))
    with pytest.raises(InputError, match=r"inputs\.tiny\.toml is '[0-9a-f]{64}' there"):
        make_corpus(tiny_spec(), folder, str(tmp_path / "c"))


def test_other_versions_are_refused(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    file = tmp_path / "c" / "corpus.json"
    file.write_text(file.read_text().replace(f'"numpy": "{__import__("numpy").__version__}"', '"numpy": "1.0"'))
    with pytest.raises(InputError, match=r"versions\.numpy is '1\.0' there and"):
        make_corpus(tiny_spec(), folder, str(tmp_path / "c"))


def test_another_corpus_in_a_place_that_was_emptied_is_that_one(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    shutil.rmtree(tmp_path / "c")
    make_corpus(tiny_spec(seed=6), folder, str(tmp_path / "c"))
    make_corpus(tiny_spec(seed=6), folder, str(tmp_path / "other"))
    assert contents(tmp_path / "c") == contents(tmp_path / "other")


def test_a_worker_that_finds_another_configuration_refuses(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(), folder, str(tmp_path / "c"))
    with pytest.raises(InputError, match=r"expected the corpus\.json of this run, found another one"):
        write_shard(Job(str(tmp_path / "c"), str(folder), "0" * 64), 0)


def test_a_folder_with_other_files_is_refused_and_untouched(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "me.jpg").write_bytes(b"x")
    with pytest.raises(InputError, match=r"expected an empty folder or a corpus, found 'me\.jpg'"):
        make_corpus(tiny_spec(), folder, str(tmp_path / "photos"))
    assert contents(tmp_path / "photos") == {"me.jpg": b"x"}


@pytest.mark.parametrize("content", ["", "{", "[]", '{"format": "other"}', '{"format": "peakmark-corpus-1"}'])
def test_a_configuration_that_is_none_is_refused(folder: Path, tmp_path: Path, content: str) -> None:
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "corpus.json").write_text(content)
    with pytest.raises(InputError, match=r"corpus\.json: expected"):
        make_corpus(tiny_spec(), folder, str(tmp_path / "c"))


def test_a_contradiction_is_found_before_the_destination_is_touched(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(SceneError):
        make_corpus(tiny_spec(markers={"kinds": ["none"]}), folder, str(tmp_path / "c"))
    assert not (tmp_path / "c").exists()


def test_a_full_disk_is_one_line_and_more_room_finishes_the_set(folder: Path, tmp_path: Path) -> None:
    """A file system of its own, 100 KB large, in a user namespace; enlarged for the second run."""
    disk, code = (
        tmp_path / "disk",
        "import sys; from tests.peaksim.corpus.helpers import make_from_arguments; make_from_arguments(sys.argv[1:])",
    )
    disk.mkdir()
    script = f"""
        mount -t tmpfs -o size=100k none {disk} || exit 77
        {sys.executable} -c '{code}' "$1" {folder} {disk}/c 2> {tmp_path}/error && exit 78
        mount -o remount,size=100M {disk} && {sys.executable} -c '{code}' "$1" {folder} {disk}/c || exit
        cp -r {disk}/c {tmp_path}/c
    """
    from peaksim.corpus.spec import spec_to_json

    spaces = ["unshare", "--map-root-user", "--user", "--mount"]
    command = [*spaces, "bash", "-c", script, "bash", spec_to_json(tiny_spec())]
    status = subprocess.run(command, env=child_environment(), timeout=300).returncode
    if status in (1, 77):
        pytest.skip("this kernel gives users no file systems of their own")
    assert status == 0
    assert "No space left on device" in (tmp_path / "error").read_text()
    assert (tmp_path / "error").read_text().count("\n") == 1
    make_corpus(tiny_spec(), folder, str(tmp_path / "whole"))
    assert contents(tmp_path / "c") == contents(tmp_path / "whole")


def test_one_renderer_draws_every_frame_whatever_its_camera(folder: Path, tmp_path: Path) -> None:
    wide = {"name": "wide", "width": 64, "height": 48, "fx": 40, "distortion": [-0.1, 0, 0, 0]}
    cameras = [{"name": "cam", "width": 64, "height": 48, "fx": 50}, wide]
    made = make_corpus(tiny_spec(renderer="auto", cameras=cameras), folder, str(tmp_path / "c"))
    records = list(open_corpus(str(tmp_path / "c")).records())
    assert {record["camera"]["name"] for record in records} == {"cam", "wide"}
    drawn_by = made.configuration.renderer, made.configuration.gl_renderer
    assert {(record["renderer"], record["gl_renderer"]) for record in records} == {drawn_by}


def test_the_manifest_says_what_made_it(folder: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(seed=77), folder, str(tmp_path / "c"))
    manifest = json.loads((tmp_path / "c" / "manifest.json").read_text())
    assert (manifest["seed"], manifest["frames"]) == (77, 12)
    assert (manifest["renderer"], manifest["gl_renderer"]) == ("exact", None)
    assert {"peakmark", "numpy", "pyarrow"} <= set(manifest["versions"])
    assert json.loads((tmp_path / "c" / "corpus.json").read_text())["spec"]["sensor"] == {
        "per": "frame",
        "read_noise": {"uniform": [0.0, 2.0]},
    }
