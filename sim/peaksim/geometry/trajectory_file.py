"""Trajectory files in common formats: TUM, EuRoC and KITTI.

Each row is one pose `world_from_camera`:

* TUM: ``time tx ty tz qx qy qz qw`` (s, m), blanks between;
* EuRoC: ``time, tx, ty, tz, qw, qx, qy, qz, …`` (whole ns, m), commas between, further columns ignored; the times are
  read as exact decimals, so 1403636580838555648 and 1.403636580838555648e+18 (numpy.savetxt) are the same;
* KITTI: the 12 numbers of the first three matrix rows, blanks between; it has no times.

Lines that start with # are comments.
"""

from collections.abc import Callable
from decimal import Decimal, InvalidOperation
from itertools import pairwise
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from peaksim.errors import SceneError, check_choice
from peaksim.geometry.trajectory import Trajectory, from_quaternions, quaternions_xyzw
from peaksim.text_file import read_text
from peaksim.whole_file import write_whole

Format = Literal["tum", "euroc", "kitti"]

KITTI_INTERVAL_S = 0.1
"""Time between the rows of a KITTI file, whose camera takes 10 images a second (Geiger et al. 2013)."""

SHORTEST_STEP_NS = 200_000
"""Steps of EuRoC's times below it, 5 000 images a second, are times in another unit, and refused: also microseconds of
more than 5 images a second."""

_LARGEST_STAMP_NS = 2**63
_LARGEST_FILE = 200_000_000  # bytes


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory; commas and the number of columns tell the format.

    Raises
    ------
    SceneError
        One line that names the file, the line, what was expected and what came.
    """
    file = Path(path)
    text = read_text(file, _LARGEST_FILE, SceneError)
    rows = [
        (n, line.strip()) for n, line in enumerate(text.splitlines(), 1) if line.strip() and line.lstrip()[0] != "#"
    ]
    if not rows:
        raise SceneError(f"{file}: expected at least one pose, got none")
    try:
        return _parsers[_format(rows[0][1])](rows)
    except SceneError as error:
        raise SceneError(f"{file}: {error}") from error


def save_trajectory(trajectory: Trajectory, path: str | Path, format: Format = "tum") -> None:
    """Write a trajectory; numbers are written in full, so that reading returns the poses to 10⁻¹²."""
    write_whole(Path(path), to_text(trajectory, format))


def to_text(trajectory: Trajectory, format: Format = "tum") -> str:
    """Return what `save_trajectory` writes."""
    check_choice(format, get_args(Format), "format")
    return _writers[format](trajectory)


def _format(row: str) -> Format:
    if "," in row:
        return "euroc"
    columns = len(row.split())
    if columns not in (8, 12):
        raise SceneError(f"expected 8 columns (TUM), 12 (KITTI) or commas (EuRoC), got {columns} columns")
    return "tum" if columns == 8 else "kitti"


def _numbers(rows: list[tuple[int, str]], separator: str | None, columns: int, exactly: bool) -> NDArray[np.float64]:
    """Return (n, columns) numbers; `exactly` refuses further columns."""
    values = []
    for number, row in rows:
        parts = row.split(separator)
        if len(parts) < columns or (exactly and len(parts) != columns):
            raise SceneError(f"line {number}: expected {columns} columns, got {len(parts)}")
        try:
            values.append([float(part) for part in parts[:columns]])
        except ValueError as error:
            raise SceneError(f"line {number}: expected numbers: {error}") from error
    table = np.array(values)
    if not np.isfinite(table).all():
        number = rows[int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0])][0]
        raise SceneError(f"line {number}: expected finite numbers, got nan or inf")
    return table


def _parse_tum(rows: list[tuple[int, str]]) -> Trajectory:
    table = _numbers(rows, None, 8, exactly=True)
    return from_quaternions(table[:, 0], table[:, 1:4], table[:, 4:])


def _parse_euroc(rows: list[tuple[int, str]]) -> Trajectory:
    table = _numbers(rows, ",", 8, exactly=False)
    # nanoseconds since 1970 do not fit a float64's 53 bits, so they are read as integers and counted from the first
    stamps = [_nanoseconds(number, row.split(",")[0].strip()) for number, row in rows]
    steps = [after - before for before, after in pairwise(stamps)]
    if steps and 0 < (step := int(np.median(np.array(steps, dtype=np.float64)))) < SHORTEST_STEP_NS:
        raise SceneError(
            f"expected times in nanoseconds, got steps of {step} ns from {stamps[0]} on: multiply seconds by 1e9, "
            "microseconds by 1000"
        )
    first_s = stamps[0] / 1e9 if stamps[0] < 10**15 else 0.0
    times_s = np.array([(stamp - stamps[0]) / 1e9 for stamp in stamps]) + first_s
    return from_quaternions(times_s, table[:, 1:4], table[:, [5, 6, 7, 4]])


def _nanoseconds(number: int, text: str) -> int:
    """Return a time stamp, exactly."""
    try:
        stamp = Decimal(text)
    except InvalidOperation as error:
        raise SceneError(f"line {number}: expected a time in whole nanoseconds, got {text!r:.40}") from error
    if not (stamp.is_finite() and abs(stamp) < _LARGEST_STAMP_NS):
        raise SceneError(f"line {number}: expected a time in nanoseconds below 2⁶³, got {text:.40}")
    if stamp != stamp.to_integral_value():
        raise SceneError(f"line {number}: expected a time in whole nanoseconds, got {text:.40}; seconds? times 1e9")
    return int(stamp)


def _parse_kitti(rows: list[tuple[int, str]]) -> Trajectory:
    table = _numbers(rows, None, 12, exactly=True)
    poses = np.tile(np.eye(4), (len(table), 1, 1))
    poses[:, :3] = table.reshape(-1, 3, 4)
    return Trajectory(KITTI_INTERVAL_S * np.arange(len(poses), dtype=np.float64), _orthonormal(poses))


def _orthonormal(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the poses with rotations made orthonormal where few decimals spoilt them; worse ones stay as they are."""
    u, _, vt = np.linalg.svd(poses[:, :3, :3])
    nearest = u @ vt
    close = np.abs(nearest - poses[:, :3, :3]).max(axis=(1, 2)) < 1e-3
    corrected = poses.copy()
    corrected[close, :3, :3] = nearest[close]
    return corrected


def _write_rows(table: NDArray[np.float64], separator: str) -> str:
    return "".join(separator.join(repr(float(value)) for value in row) + "\n" for row in table)


def _format_tum(trajectory: Trajectory) -> str:
    table = np.column_stack([trajectory.times_s, trajectory.world_from_camera[:, :3, 3], quaternions_xyzw(trajectory)])
    return "# time_s tx_m ty_m tz_m qx qy qz qw (world_from_camera)\n" + _write_rows(table, " ")


def _format_euroc(trajectory: Trajectory) -> str:
    quaternions = quaternions_xyzw(trajectory)[:, [3, 0, 1, 2]]
    table = np.column_stack([trajectory.world_from_camera[:, :3, 3], quaternions])
    stamps = np.rint(trajectory.times_s * 1e9).astype(np.int64)
    rows = _write_rows(table, ",").splitlines()
    head = "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w,q_x,q_y,q_z\n"
    return head + "".join(f"{stamp},{row}\n" for stamp, row in zip(stamps, rows, strict=True))


def _format_kitti(trajectory: Trajectory) -> str:
    return _write_rows(trajectory.world_from_camera[:, :3].reshape(-1, 12), " ")


_parsers: dict[Format, Callable[[list[tuple[int, str]]], Trajectory]] = {
    "tum": _parse_tum,
    "euroc": _parse_euroc,
    "kitti": _parse_kitti,
}
_writers: dict[Format, Callable[[Trajectory], str]] = {
    "tum": _format_tum,
    "euroc": _format_euroc,
    "kitti": _format_kitti,
}
