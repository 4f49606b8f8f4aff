"""The figures of an evaluation, with 95 % intervals, and what is written of them: report.html and result.json."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from peakmark.experiments.cave.evaluation import EvaluationConfig, PoseKind, ViewRecord
from peakmark.plain import plain_fields
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import result_folder, write_json
from peakmark.score.markers import MarkerScore
from peakmark.score.poses import WRONG_DEG
from peakmark.score.statistics import Bin, Quantiles, Rate, quantiles, rate
from peakmark.score.statistics import recall_by as recall_by_bins

PERCENTS = (50, 95, 99)

BINS = {"side_px": (0, 12, 16, 20, 25, 32, 45, 70, 1000), "tilt_deg": (0, 15, 30, 45, 55, 65, 90)}
"""Edges of the bins by which recall is broken down."""


@dataclass(frozen=True)
class ArrayPoseFigures:
    """The errors of all poses of one kind."""

    arrays: float | None
    """Mean number of arrays a pose; None without poses."""
    mm: Quantiles
    deg: Quantiles
    """Errors of position and rotation."""
    flips: Rate
    """Poses that are the mirrored one."""
    certain: Rate
    """Poses without a rival."""
    flips_among_certain: Rate
    """Mirrored poses among those without a rival."""
    farther_than_5_deg: int
    """Poses whose rotation is so far from the truth, `WRONG_DEG`."""


@dataclass(frozen=True)
class EvaluationFigures:
    """All figures of an evaluation; "wanted" markers and arrays are those that must be found."""

    views: int
    features: int
    """Median number of key points a view."""
    recall: Rate
    """Wanted markers that were found."""
    polarity_errors: Rate
    polarity_errors_by_signature: Rate
    """Found ones with the wrong sign of the Laplacian, and with the other polarity's signature."""
    localisation_px: Quantiles
    """Distance of the found ones from their true centres."""
    false_detections_per_view: float | None
    """Detections at no visible marker; None without views."""
    arrays_decoded: Rate
    """Wanted arrays that were read rightly."""
    wrong_codes: Rate
    """Codes that hang not there, among all that were read."""
    unsure_per_view: float | None
    """Readings without a code; None without views."""
    arrays_decoded_by_paper: Rate
    wrong_codes_by_paper: int
    """The same by the paper's rule; of its wrong codes the number."""
    pose: dict[PoseKind, ArrayPoseFigures]
    """By what the poses rest on."""
    time_s: dict[str, float]
    """Median seconds by stage."""


def evaluation_figures(records: Sequence[ViewRecord]) -> EvaluationFigures:
    """Return all figures of an evaluation's records."""
    frames = [record.frame for record in records]
    counts = [frame.counts for frame in frames]
    markers = [marker for record in records for marker in record.markers if marker.is_wanted]
    found = [marker for marker in markers if marker.is_found]
    arrays = [array for record in records for array in record.arrays]
    stages = frames[0].time_s if frames else ()
    return EvaluationFigures(
        views=len(records),
        features=int(np.median([frame.features for frame in frames])) if frames else 0,
        recall=rate(len(found), len(markers)),
        polarity_errors=rate(sum(not marker.is_polarity_right for marker in found), len(found)),
        polarity_errors_by_signature=rate(sum(not marker.is_signature_right for marker in found), len(found)),
        localisation_px=quantiles(_errors_px(found), PERCENTS),
        false_detections_per_view=_mean([one.false_detections for one in counts]),
        arrays_decoded=rate(sum(array.is_decoded for array in arrays), len(arrays)),
        wrong_codes=rate(sum(one.wrong_codes for one in counts), sum(len(frame.codes) for frame in frames)),
        unsure_per_view=_mean([one.unsure for one in counts]),
        arrays_decoded_by_paper=rate(sum(array.is_decoded_by_paper for array in arrays), len(arrays)),
        wrong_codes_by_paper=sum(one.wrong_codes_by_paper for one in counts),
        pose={kind: pose_figures(records, kind) for kind in get_args(PoseKind)},
        time_s={stage: float(np.median([frame.time_s[stage] for frame in frames])) for stage in stages},
    )


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _errors_px(markers: Sequence[MarkerScore]) -> list[float]:
    return [np.nan if marker.error_px is None else marker.error_px for marker in markers]


def pose_figures(records: Sequence[ViewRecord], kind: PoseKind) -> ArrayPoseFigures:
    """Return the errors of the poses of one kind, all of them and those without a rival."""
    poses = [pose for record in records for pose in record.poses if pose.kind == kind]
    certain = [pose for pose in poses if pose.is_certain]
    return ArrayPoseFigures(
        arrays=_mean([pose.arrays for pose in poses]),
        mm=quantiles([pose.mm for pose in poses], PERCENTS),
        deg=quantiles([pose.deg for pose in poses], PERCENTS),
        flips=rate(sum(pose.is_flipped for pose in poses), len(poses)),
        certain=rate(len(certain), len(poses)),
        flips_among_certain=rate(sum(pose.is_flipped for pose in certain), len(certain)),
        farther_than_5_deg=sum(pose.deg > WRONG_DEG for pose in poses),
    )


def recall_by(records: Sequence[ViewRecord], quantity: str) -> list[Bin]:
    """Return one row a bin of `BINS[quantity]` that holds markers fully in view: what was found of them."""
    markers = [marker for record in records for marker in record.markers if marker.is_in_view]
    values = [getattr(marker, quantity) for marker in markers]
    return recall_by_bins(BINS[quantity], values, _errors_px(markers), PERCENTS)


def bin_row(row: Bin) -> dict[str, Any]:
    """Return a bin as result.json has it."""
    return {"low": row.low, "high": row.high, "recall": row.recall, "error_px_p95": row.error_px[95]}


def headline(figures: EvaluationFigures) -> list[tuple[Any, ...]]:
    """Return rows (figure, value, low, high, of) for the report and the terminal."""
    rows = [value.row(name.replace("_", " ")) for name, value in vars(figures).items() if isinstance(value, Rate)]
    plain = ("views", "features", "false_detections_per_view", "unsure_per_view", "wrong_codes_by_paper")
    rows += [(name.replace("_", " "), getattr(figures, name), None, None, None) for name in plain]
    rows += figures.localisation_px.rows("marker (px)")
    for kind, pose in figures.pose.items():
        label = {"one": "pose from one array", "several": "pose from 3 or more", "wall": "pose from a wall"}[kind]
        rows += pose.mm.rows(f"{label} (mm)") + pose.deg.rows(f"{label} (°)")
        rows += [pose.flips.row(f"{label}: flips"), pose.certain.row(f"{label}: certain")]
        rows.append(pose.flips_among_certain.row(f"{label}: flips among certain"))
    return rows


HEAD = ("figure", "value", "low", "high", "of")


def write_evaluation(config: EvaluationConfig, records: Sequence[ViewRecord], out: Path) -> EvaluationFigures:
    """Write report.html and result.json, and return the figures."""
    by = {quantity: recall_by(records, quantity) for quantity in BINS}
    figures = evaluation_figures(records)
    lead = (
        f"{figures.views} random views of {config.rooms} {config.split} rooms, images at "
        f"{config.size:g} of their cameras' width and height, seed {config.seed}. Wanted: "
        "markers and arrays wholly in view, 20 px or larger, tilted to 45°. Intervals: 95 %."
    )
    sections = [Section("Figures", table=Table(HEAD, headline(figures)))]
    sections += [
        Section(
            f"All markers fully in view, by {name}",
            table=Table(
                ("from", "to", *HEAD[1:], "error p95 (px)"),
                [(row.low, row.high, *astuple(row.recall), row.error_px[95]) for row in rows],
            ),
        )
        for name, rows in by.items()
    ]
    bins = {name: [bin_row(row) for row in rows] for name, rows in by.items()}
    with result_folder(out) as folder:
        write_report(folder / "report.html", "SIFT/SURF CAVE: random views", lead, sections)
        write_json(folder / "result.json", {**plain_fields(figures), "recall_by": bins, "config": config})
    return figures
