"""Flies the standard sample, pools it, and writes the tables: report.html, result.json and a folder a flight."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from peakmark.experiments.floor import flight_results
from peakmark.experiments.floor.empty_images import bare_floors, photographs, silence
from peakmark.experiments.floor.flights import FLIGHTS, flight_config, pooled, read_flight
from peakmark.experiments.floor.stretch_sweep import stretch_table
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import result_folder, write_json
from peakmark.score.plain_statistics import quantile_rows, rate_row

Progress = Callable[[str], None]


def run(
    out: str | Path,
    frames: int | None = None,
    is_resumed: bool = False,
    flights: Sequence[tuple[str, str, int]] = FLIGHTS,
    on_step: Progress = lambda what: None,
) -> dict[str, Any]:
    """Fly, look at pictures without markers, measure the stretch; return what `result.json` holds.

    Parameters
    ----------
    out
        Folder; each flight gets one of its own in it.
    frames
        Of each flight, from its start; None takes all.
    is_resumed
        Keep finished flights, and the finished frames of the others.
    flights
        Ride, floor and seed of each.
    on_step
        Called with what comes next.

    Raises
    ------
    InputError
        If a folder cannot be written, or holds frames of another flight.
    """
    folders = []
    for ride, floor, seed in flights:
        name = f"{ride}-{floor}-{seed}"
        on_step(f"fly {name}")
        folders.append(Path(out) / name)
        if not (is_resumed and (folders[-1] / "result.json").is_file()):
            flight_results.run(flight_config(ride, floor, seed, frames), folders[-1], is_resumed)
    result = pooled([read_flight(folder) for folder in folders])
    on_step("pictures without markers")
    result["blank"] = {"rendered": silence(bare_floors()), "photographs": silence(photographs())}
    on_step("stretches")
    result["stretch"] = stretch_table()
    with result_folder(out) as folder:
        write_report(folder / "report.html", "Markers over many flights", _lead(result), sections(result))
        write_json(folder / "result.json", result)
    return result


def _lead(result: dict[str, Any]) -> str:
    return f"{len(result['flights'])} flights, {result['detection']['frames']} frames, floors never tuned for."


def sections(result: dict[str, Any]) -> list[Section]:
    """Return the tables of the report."""
    return [
        Section(
            "Figures",
            "95 % intervals: Wilson for rates, bootstrap for quantiles.",
            Table(("figure", "value", "low", "high", "of"), headline(result)),
        ),
        *(
            Section(f"By {quantity.rsplit('_', 1)[0]}", table=Table(_BREAKDOWN, [_bin(row) for row in rows]))
            for quantity, rows in result["breakdown"].items()
        ),
        Section(
            "Stretch",
            "The same frames; markers fully in view from 10 px on, as they are in the picture.",
            Table(_STRETCH, [_stretch(row) for row in result["stretch"]]),
        ),
        Section("Flights", table=Table(_FLIGHT, [_flight(row) for row in result["flights"]])),
    ]


_BREAKDOWN = ("from…to", "markers", "recall", "low", "high", "precision", "low", "stands out", "margin p50")
_STRETCH = ("stretch", "recall", "low", "high", "tilt < 60°", "tilt ≥ 60°", "precision", "response drop p50")
_FLIGHT = ("flight", "frames", "recall", "precision", "false", "located", "map ATE (mm)", "no map ATE (mm)", "swaps")


def headline(result: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Return name, value, interval and number of cases of the figures that count."""
    found, pose = result["detection"], result["pose"]
    rows = [
        rate_row("recall, markers ≥ 20 px after stretching", found["recall"]),
        rate_row("precision", found["precision"]),
        ("false detections a megapixel", found["false_per_megapixel"], None, None, found["frames"]),
        rate_row("frames whose markers are uniquely detectable", found["uniquely_detectable"]),
    ]
    for title, silent in result.get("blank", {}).items():
        rows += [rate_row(f"{title} without markers that stay silent", v) for k, v in silent.items() if k != "loud"]
    for name, title in (("rounded", "rounded scale"), ("scale", "scale"), ("refined", "refined shape")):
        rows += quantile_rows(f"distance from {title}, relative error", result["distance"][name])
    rows += [
        rate_row("frames located in the map, each by itself", pose["located_alone"]),
        rate_row("frames located in the map, with tracking", pose["located"]),
        ("wrong poses accepted", pose["wrong"], None, None, pose["located"]["of"]),
        *quantile_rows("position with the map (mm)", pose["position_mm"]),
        *quantile_rows("rotation with the map (°)", pose["rotation_deg"]),
    ]
    return rows


def _bin(row: dict[str, Any]) -> tuple[Any, ...]:
    recall, precision = row["recall"], row["precision"]
    return (
        f"{row['low']}…{row['high']}",
        recall["of"],
        recall["value"],
        recall["low"],
        recall["high"],
        precision["value"],
        precision["low"],
        row["stands_out"]["value"],
        row["margin"],
    )


def _stretch(row: dict[str, Any]) -> tuple[Any, ...]:
    recall = row["recall"]
    return (
        row["stretch"],
        recall["value"],
        recall["low"],
        recall["high"],
        row["recall_below_60_deg"]["value"],
        row["recall_from_60_deg"]["value"],
        row["precision"]["value"],
        row["response_drop"]["p50"],
    )


def _flight(row: dict[str, Any]) -> tuple[Any, ...]:
    return (
        row["flight"],
        row["frames"],
        row["recall"]["value"],
        row["precision"]["value"],
        row["false"],
        row["located"],
        row["map_ate_mm"],
        row["motion_ate_mm"],
        row["track_swaps"],
    )
