"""Records of runs: a run's run.json, or the same as a baseline; one line a frame, so that diffs are readable."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from peaksim.scene.schema import NotNegative, StrictTable
from peaksim.toml_file import validate
from pydantic import Field, field_validator

from peakmark.errors import InputError
from peakmark.regress.detector import DetectorSettings
from peakmark.regress.frame import Count, ScoredFrame
from peakmark.regress.metrics import metrics_of
from peakmark.score.statistics import resample_counts

FORMAT = "peakmark-regress-1"


@dataclass(frozen=True)
class Record:
    """A run's outcome, without times of day or of computing: the same run gives the same bytes."""

    suite: str
    """The suite's name."""
    suite_sha256: str
    """Hash of what decides the frames."""
    detector: DetectorSettings
    """What was tested; its time limit is not kept."""
    seed: int
    """Of the sensor noise."""
    renderer: str
    """"exact" or "gl"."""
    versions: dict[str, str]
    """Package → version."""
    tolerances: dict[str, float]
    """The suite's, by metric."""
    results: tuple[ScoredFrame, ...]
    """One a frame, by index."""


def to_text(record: Record) -> str:
    """Return a record as JSON with one line for each metric and frame."""
    metrics = metrics_of(record.results, record.tolerances)
    counts = resample_counts(len(record.results))
    figures = {
        m.key: {
            "value": _short(m.value()),
            "unit": m.unit,
            "direction": m.direction,
            "tolerance": m.tolerance,
            "relative": m.relative,
            "interval": [_short(v) for v in m.interval(counts) or (None, None)],
        }
        for m in metrics
    }
    detector = {name: value for name, value in asdict(record.detector).items() if name != "time_limit_s"}
    head = {"format": FORMAT, **{name: getattr(record, name) for name in _HEAD}, "detector": detector}
    lines = [f"{_json(name)}: {_json(value)}" for name, value in head.items()]
    lines.append('"metrics": {\n' + ",\n".join(f"{_json(k)}: {_json(v)}" for k, v in figures.items()) + "\n}")
    lines.append('"frames": [\n' + ",\n".join(_json(asdict(result)) for result in record.results) + "\n]")
    return "{\n" + ",\n".join(lines) + "\n}\n"


_HEAD = ("suite", "suite_sha256", "detector", "seed", "renderer", "versions", "tolerances")


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _short(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")


class _File(StrictTable):
    """A record as its file states it."""

    format: str
    suite: str
    suite_sha256: str
    detector: DetectorSettings
    seed: Count
    renderer: str
    versions: dict[str, str]
    tolerances: dict[str, NotNegative]
    metrics: Any = None
    frames: Annotated[tuple[ScoredFrame, ...], Field(min_length=1)]

    @field_validator("detector", mode="before")
    @classmethod
    def _is_whole(cls, value: Any) -> Any:
        missing = {"name", "stretch", "parameters"} - set(value if isinstance(value, dict) else ())
        if missing:
            raise ValueError(f"expected a detector with name, stretch and parameters, got none of {sorted(missing)}")
        return value


def from_text(text: str, name: str) -> Record:
    """Read a record; its metrics are computed again, not read.

    Raises
    ------
    InputError
        One line that names the file and the field, if it is no record or of another version.
    """
    expected = f"{name}: expected the record of a run"
    try:
        values = json.loads(text, parse_constant=_refuse_number)
        json.dumps(values, ensure_ascii=False).encode()  # half a surrogate pair can be read, but not be written again
    except (ValueError, RecursionError) as error:
        raise InputError(f"{expected}: {error}") from error
    version = values.get("format") if isinstance(values, dict) else None
    if isinstance(version, str) and version != FORMAT:
        raise InputError(f"{name}: expected a record of version {FORMAT!r}, got {version!r:.80}")
    file = validate(_File, values, expected)
    return Record(**{name: getattr(file, name) for name in _HEAD}, results=file.frames)


def _refuse_number(text: str) -> None:
    raise ValueError(f"expected numbers, got {text}")


def read_record(path: Path) -> Record:
    """Read a record's file.

    Raises
    ------
    InputError
        As `from_text`, or if it cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    return from_text(text, str(path))
