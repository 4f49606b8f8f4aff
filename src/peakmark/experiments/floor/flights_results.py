"""Flies the standard sample, pools it, and writes the tables: report.html, result.json and a folder a flight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from peakmark.experiments.floor.empty_images import FalsePositives, bare_floors, count_false_positives, photographs
from peakmark.experiments.floor.flight_report import HEAD, INTERVALS, Row, detection_rows, distance_rows, pose_rows
from peakmark.experiments.floor.flight_results import fly_and_keep
from peakmark.experiments.floor.flights import FLIGHTS, BreakdownRow, FlightRow, PooledFigures, flight_config, pooled
from peakmark.experiments.floor.stretch_sweep import StretchRow, stretch_table
from peakmark.plain import INLINED
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import result_folder, write_json


@dataclass(frozen=True)
class FlightsResult:
    """What result.json holds; the pooled figures lie at its top."""

    pooled: PooledFigures = field(metadata=INLINED)
    blank: dict[str, FalsePositives]
    """"rendered" and "photographs": detections in images without markers."""
    stretch: list[StretchRow]


def run_flights(
    out: str | Path,
    frames: int | None = None,
    is_resumed: bool = False,
    flights: Sequence[tuple[str, str, int]] = FLIGHTS,
    on_stage: Callable[[str], None] = lambda what: None,
) -> FlightsResult:
    """Fly, search images without markers, measure the stretch; return what `result.json` holds.

    Each of the flights (ride, floor and seed) gets a folder in `out`, and takes only so many frames from its start.
    With `is_resumed` what an interrupted run left is kept: finished flights, and the finished frames of the others.
    `on_stage` is called with what comes next.

    Raises
    ------
    InputError
        If a folder cannot be written, or holds frames of another flight.
    """
    finished = []
    for ride, floor, seed in flights:
        name = f"{ride}-{floor}-{seed}"
        on_stage(f"fly {name}")
        finished.append(fly_and_keep(flight_config(ride, floor, seed, frames), Path(out) / name, is_resumed))
    figures = pooled([flown for flown, _, _ in finished], [result for _, result, _ in finished])
    on_stage("images without markers")
    images = {"rendered": bare_floors(), "photographs": photographs()}
    blank = {title: count_false_positives(of_title) for title, of_title in images.items()}
    on_stage("stretches")
    result = FlightsResult(figures, blank, stretch_table())
    with result_folder(out) as folder:
        lead = f"{len(finished)} flights, {figures.detection.frames} frames, floors never tuned for."
        write_report(folder / "report.html", "Markers over many flights", lead, sections(result))
        write_json(folder / "result.json", result)
    for _, _, journal in finished:
        journal.remove()
    return result


def sections(result: FlightsResult) -> list[Section]:
    """Return the tables of the report."""
    return [
        Section("Figures", INTERVALS, Table(HEAD, headline(result))),
        *(
            Section(f"By {quantity.rsplit('_', 1)[0]}", table=Table(_BREAKDOWN, [_bin_cells(row) for row in rows]))
            for quantity, rows in result.pooled.breakdown.items()
        ),
        Section(
            "Stretch",
            "The same frames; markers fully in view from 10 px on, as they are in the image.",
            Table(_STRETCH, [_stretch_cells(row) for row in result.stretch]),
        ),
        Section("Flights", table=Table(_FLIGHT, [_flight_cells(row) for row in result.pooled.flights])),
    ]


_BREAKDOWN = ("from…to", "markers", "recall", "low", "high", "precision", "low", "stands out", "margin p50")
_STRETCH = ("stretch", "recall", "low", "high", "tilt < 60°", "tilt ≥ 60°", "precision", "response drop p50")
_FLIGHT = ("flight", "frames", "recall", "precision", "false", "located", "map ATE (mm)", "no map ATE (mm)", "swaps")


def headline(result: FlightsResult) -> list[Row]:
    """Return name, value, interval and number of cases of the figures that count."""
    return [
        *detection_rows(result.pooled.detection),
        *(
            share.row(f"{title} without markers and without a detection")
            for title, images in result.blank.items()
            for share in images.without.values()
        ),
        *distance_rows(result.pooled.distance),
        *pose_rows(result.pooled.pose),
    ]


def _bin_cells(row: BreakdownRow) -> Row:
    recall, precision, margin = row.recall, row.precision, (row.stands_out.value, row.margin)
    of_bin = (f"{row.low}…{row.high}", recall.of, recall.value, recall.low, recall.high)
    return (*of_bin, precision.value, precision.low, *margin)


def _stretch_cells(row: StretchRow) -> Row:
    by_tilt = (row.recall_below_60_deg.value, row.recall_from_60_deg.value)
    recall = (row.recall.value, row.recall.low, row.recall.high, *by_tilt)
    return (row.stretch, *recall, row.precision.value, row.response_drop[50])


def _flight_cells(row: FlightRow) -> Row:
    found = (row.recall.value, row.precision.value, row.false, row.located)
    return (row.flight, row.frames, *found, row.map_ate_mm, row.motion_ate_mm, row.track_swaps)
