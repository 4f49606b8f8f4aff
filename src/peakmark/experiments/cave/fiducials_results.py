"""Results of the comparison of fiducials: rates.png, report.html and result.json."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from peakmark.experiments.cave.fiducials import DESIGNS, SWEEPS, DesignComparison, conditions
from peakmark.report import plots
from peakmark.report.page import Section, Table, svg_uri, write_report
from peakmark.report.results import result_folder, write_json

UNITS = {
    "side_px": "side of a marker or tag (px)",
    "tilt_deg": "tilt (°)",
    "noise": "noise σ (grey levels)",
    "blur_px": "blur σ (px)",
    "occluded": "covered share of the width",
}
HEAD = ("condition", *DESIGNS)


def write_comparison(rows: Sequence[DesignComparison], trials: int, seed: int, out: Path) -> None:
    """Write rates.png, report.html and result.json."""
    figure = rates_figure(rows)
    lead = (
        f"{trials} images a condition and design, seed {seed}. Right ids, and in brackets the number of wrong ones. "
        "Unless varied: side 40 px, no tilt, noise 2, blur 0.6 px, nothing covered; any roll, exposure 0.7. "
        "The side is that of one marker or tag; an array takes 2.5 × 2.5 of them."
    )
    sections = [
        Section("Detection rate", image=svg_uri(figure)),
        Section("Right ids (wrong ones)", table=Table(HEAD, table_rows(rows))),
        Section("Error of the centre, rms px", table=Table(HEAD, table_rows(rows, "error_px_rms"))),
        Section("Seconds in a 384×288 px image, median", table=Table(HEAD, table_rows(rows, "seconds"))),
    ]
    with result_folder(out) as folder:
        plots.save(figure, folder / "rates.png")
        write_report(folder / "report.html", "Markers, arrays, ArUco and AprilTag", lead, sections)
        write_json(folder / "result.json", {"trials": trials, "seed": seed, "rows": rows})


def table_rows(rows: Sequence[DesignComparison], figure: str | None = None) -> list[tuple[Any, ...]]:
    """Return one row a condition, one column a design: right ids with the wrong ones in brackets, or a figure."""
    cells = {(r.quantity, r.value, r.design): _counts(r) if figure is None else getattr(r, figure) for r in rows}
    return [
        (f"{UNITS[quantity]}: {value:g}", *(cells[quantity, value, design] for design in DESIGNS))
        for quantity, value, _ in conditions()
    ]


def _counts(row: DesignComparison) -> str:
    return f"{row.right}" + (f" ({row.wrong})" if row.wrong else "")


def rates_figure(rows: Sequence[DesignComparison]) -> Any:
    """Return the detection rates over each quantity, one panel each."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 6), layout="tight")
    for k, quantity in enumerate(SWEEPS):
        ax = figure.add_subplot(2, 3, k + 1)
        for design, style in zip(DESIGNS, ("o-", "s-", "^--", "v--"), strict=True):
            chosen = [row for row in rows if (row.quantity, row.design) == (quantity, design)]
            values, rates = [r.value for r in chosen], [r.right / r.trials for r in chosen]
            ax.plot(values, rates, style, markersize=4, linewidth=1.2, label=design)
        ax.set(xlabel=UNITS[quantity], ylim=(-0.03, 1.03), ylabel="share with the right id" if k % 3 == 0 else "")
        ax.grid(alpha=0.3)
    handles, names = ax.get_legend_handles_labels()
    figure.legend(handles, names, loc="lower right", bbox_to_anchor=(0.95, 0.15), frameon=False)
    return figure
