"""Records of runs: run.json of a run, and the same content accepted as a baseline; one line a frame, so diffs read."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from peakmark.errors import InputError
from peakmark.regress.frame import FrameResult, from_plain
from peakmark.regress.metrics import metrics_of, resample_counts

FORMAT = "peakmark-regress-1"


@dataclass(frozen=True)
class Record:
    """A run's outcome, without times of day or of computing: the same run gives the same bytes."""

    suite: str
    """The suite's name."""
    suite_sha256: str
    """Of what decides the frames."""
    detector: dict[str, Any]
    """Name, stretch and parameters."""
    seed: int
    """Of the sensor noise."""
    renderer: str
    """"exact" or "gl"."""
    versions: dict[str, str]
    """Package → version."""
    tolerances: dict[str, float]
    """The suite's, by metric."""
    results: tuple[FrameResult, ...]
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
    head = {"format": FORMAT, **{name: getattr(record, name) for name in _HEAD}}
    lines = [f"{_json(name)}: {_json(value)}" for name, value in head.items()]
    lines.append('"metrics": {\n' + ",\n".join(f"{_json(k)}: {_json(v)}" for k, v in figures.items()) + "\n}")
    lines.append('"frames": [\n' + ",\n".join(_json(result.to_plain()) for result in record.results) + "\n]")
    return "{\n" + ",\n".join(lines) + "\n}\n"


_HEAD = ("suite", "suite_sha256", "detector", "seed", "renderer", "versions", "tolerances")


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _short(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")


def from_text(text: str, name: str) -> Record:
    """Read a record; its metrics are computed again, not read.

    Raises
    ------
    InputError
        That names the file, if it is no record or of another version.
    """
    try:
        values = json.loads(text)
        if values["format"] != FORMAT:
            raise InputError(f"{name}: expected a record of version {FORMAT!r}, got {values['format']!r}")
        results = tuple(from_plain(plain) for plain in values["frames"])
        tolerances = {str(key): float(value) for key, value in values["tolerances"].items()}
        head = {field: values[field] for field in _HEAD if field != "tolerances"}
        return _checked(Record(**head, tolerances=tolerances, results=results))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name}: expected the record of a run: {error!r:.80}") from error


def _checked(record: Record) -> Record:
    """Return a record whose reports can be written; frames are scored when they are compared."""
    if not record.results or not {"name", "stretch", "parameters"} <= record.detector.keys():
        raise ValueError("expected frames, and a detector with name, stretch and parameters")
    record.detector["parameters"].items(), record.versions.items(), metrics_of(record.results, record.tolerances)
    return record


def read_record(path: Path) -> Record:
    """Read a record's file.

    Raises
    ------
    InputError
        As `from_text`, or if it cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    return from_text(text, str(path))
