"""Trajectory files: written and read back, foreign files as their makers define them, and refused ones."""

from pathlib import Path

import numpy as np
import pytest
from peaksim import load_trajectory
from peaksim.errors import InputError, SceneError
from peaksim.geometry.pose import look_at
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import Format, save_trajectory


@pytest.mark.parametrize("format", ["tum", "euroc", "kitti"])
def test_write_then_read(tmp_path: Path, format: Format) -> None:
    poses = [look_at(eye, [0, 0, 0.5]) for eye in np.random.default_rng(0).normal(size=(37, 3))]
    trajectory = Trajectory(0.1 * np.arange(37), np.stack(poses))  # 0.1 s a step, which KITTI assumes
    save_trajectory(trajectory, tmp_path / "path", format)
    again = load_trajectory(tmp_path / "path")
    assert np.allclose(again.times_s, trajectory.times_s, atol=1e-9)
    assert np.allclose(again.world_from_camera, trajectory.world_from_camera, atol=1e-12)


def test_tum_as_its_authors_define_it(tmp_path: Path) -> None:
    # a rotation by 90° about z: (qx, qy, qz, qw) = (0, 0, √½, √½); x of the camera points along world y
    (tmp_path / "g.txt").write_text("# timestamp tx ty tz qx qy qz qw\n1305031.5 1 2 3 0 0 0.70710678 0.70710678\n")
    trajectory = load_trajectory(tmp_path / "g.txt")
    assert trajectory.times_s == [1305031.5]
    assert np.allclose(trajectory.world_from_camera[0, :3], [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]], atol=1e-7)


def test_euroc_has_nanoseconds_w_first_and_further_columns(tmp_path: Path) -> None:
    rows = "\n".join(f"{1403636580838555648 + i * 5_000_000},1,2,3,0.70710678,0,0,0.70710678,9,9,9" for i in range(3))
    (tmp_path / "data.csv").write_text("#timestamp, p_RS_R_x [m], ...\n" + rows)
    trajectory = load_trajectory(tmp_path / "data.csv")
    assert np.allclose(np.diff(trajectory.times_s), 0.005, atol=1e-12)
    assert np.allclose(trajectory.world_from_camera[0, :3], [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]], atol=1e-7)


def test_kitti_rotations_with_few_decimals_are_mended(tmp_path: Path) -> None:
    (tmp_path / "00.txt").write_text("0.8660 -0.5 0 1 0.5 0.8660 0 2 0 0 1 3\n")
    trajectory = load_trajectory(tmp_path / "00.txt")
    assert np.allclose(trajectory.world_from_camera[0, :3, 3], [1, 2, 3])
    assert trajectory.world_from_camera[0, 1, 0] == pytest.approx(0.5, abs=1e-4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected at least one pose"),
        ("# only a comment\n", "expected at least one pose"),
        ("1 2 3\n", "expected 8 columns"),
        ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0\n", "line 2: expected 8 columns, got 7"),
        ("0 0 0 zero 0 0 0 1\n", "line 1: expected numbers"),
        ("0 0 0 nan 0 0 0 1\n", "line 1: expected finite numbers"),
        ("0 0 0 0 0 0 0 2\n", "pose 0: expected a unit quaternion, got one of length 2"),
        ("0 0 0 0 0 0 0 0\n", "pose 0: expected a unit quaternion"),
        ("0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n", "strictly increasing times, got 0 followed by 0"),
        ("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "strictly increasing times, got 2 followed by 1"),
        ("1 0 0 0 0 2 0 0 0 0 1 0\n", "pose 0: expected a rigid transform"),
    ],
)
def test_faulty_files_are_one_line_that_names_them(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "bad.txt"
    file.write_text(text)
    with pytest.raises(SceneError) as caught:
        load_trajectory(file)
    assert str(caught.value).startswith(str(file))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_and_binary_files(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="cannot be read"):
        load_trajectory(tmp_path / "nowhere")
    (tmp_path / "b").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SceneError, match="is not a text file"):
        load_trajectory(tmp_path / "b")


def test_times_of_a_short_way_survive(tmp_path: Path) -> None:
    trajectory = Trajectory(np.array([0, 1 / 3]), np.stack([np.eye(4)] * 2))
    save_trajectory(trajectory, tmp_path / "w")
    assert isinstance(again := load_trajectory(tmp_path / "w"), Trajectory)
    assert again.times_s[1] == 1 / 3


def test_a_format_that_is_none_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="format: expected one of tum, euroc, kitti, got 'csv'"):
        save_trajectory(Trajectory(np.zeros(1), np.eye(4)[None]), tmp_path / "t.csv", "csv")  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "stamps",
    [
        ("1403636580838555648", "1403636580888555648"),
        ("1.403636580838555648e+18", "1.403636580888555648e+18"),  # numpy.savetxt
        ("1403636580838555648.0", "1.403636580888555648E18"),
    ],
)
def test_euroc_times_are_exact_decimals(tmp_path: Path, stamps: tuple[str, str]) -> None:
    (tmp_path / "data.csv").write_text("".join(f"{stamp},1,2,3,1,0,0,0\n" for stamp in stamps))
    assert np.array_equal(load_trajectory(tmp_path / "data.csv").times_s, [0, 0.05])


def test_short_euroc_times_start_at_their_own_second(tmp_path: Path) -> None:
    (tmp_path / "data.csv").write_text("".join(f"{k}.0e+09,1,2,3,1,0,0,0\n" for k in (1, 2, 3)))
    assert np.array_equal(load_trajectory(tmp_path / "data.csv").times_s, [1, 2, 3])


@pytest.mark.parametrize(
    ("stamps", "message"),
    [
        (("0", "1", "2"), "expected times in nanoseconds, got steps of 1 ns from 0 on: multiply seconds by 1e9, micro"),
        (("1403636580838555", "1403636580888555"), "got steps of 50000 ns from 1403636580838555 on"),
        (("1403636580", "1403636581"), "got steps of 1 ns from 1403636580 on"),
        (("0", "50", "100"), "got steps of 50 ns"),
        (("0.0", "0.05"), "line 2: expected a time in whole nanoseconds, got 0.05; seconds? times 1e9"),
        (("1403636580.838555648",), "line 1: expected a time in whole nanoseconds, got 1403636580.838555648"),
        (("12345678901234567890",), "line 1: expected a time in nanoseconds below 2⁶³, got 12345678901234567890"),
        (("1e300",), "line 1: expected a time in nanoseconds below 2⁶³, got 1e300"),
        (("1e-300000000",), "line 1: expected a time in whole nanoseconds, got 1e-300000000"),
        (("x",), "line 1: expected numbers"),
    ],
)
def test_euroc_times_in_another_unit_are_refused(tmp_path: Path, stamps: tuple[str, ...], message: str) -> None:
    file = tmp_path / "data.csv"
    file.write_text("".join(f"{stamp},1,2,3,1,0,0,0\n" for stamp in stamps))
    with pytest.raises(SceneError) as caught:
        load_trajectory(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert message in str(caught.value)
