"""What a comparison writes: data.json, index.md and report.html, which say the same, and rates.png."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from peaksim.extras import needs_extra

from peakmark.experiments.comparison.figures import UNITS as FIGURE_UNITS
from peakmark.experiments.comparison.figures import WHAT, ComparisonFigures, Figure, Line, Topic, ranked_of, value_at
from peakmark.experiments.comparison.frames import SWEEPS
from peakmark.report import plots
from peakmark.report.page import Section, Table, markdown_table, svg_uri, write_report
from peakmark.report.results import result_folder, write_json

TITLE = "Markers, arrays, tags, rings and corners of one printed area"

AXES = {
    "side_px": "side (px)",
    "tilt_deg": "tilt (°)",
    "noise": "noise σ (grey levels)",
    "blur_px": "blur σ (px)",
    "shadow": "light that stripes of shadow take",
    "exposure": "light",
    "covered": "covered share of the width",
}

_STYLES = ("o-", "o--", "P-", "h--", "h:", "s-", "v-", "v--", "v:", "^--", "^:", "D-.", "x:")
_COLOURS = (
    "#0969da",
    "#54aeff",
    "#1b7c83",
    "#9a6700",
    "#d4a72c",
    "#1a7f37",
    "#bc4c00",
    "#d4691e",
    "#8250df",
    "#cf222e",
    "#bf3989",
    "#57606a",
    "#aaaaaa",
)


def write_comparison(figures: ComparisonFigures, out: Path) -> None:
    """Write data.json, index.md, report.html and rates.png."""
    figure = rates_figure(figures)
    sections = [Section(title, text=text) for title, text in in_short(figures)]
    sections.append(Section("Who wins", text=RULE, table=Table(VERDICT_HEAD, verdict_rows(figures))))
    if honesty := honesty_rows(figures):
        sections.append(Section(HONESTY, table=Table(*honesty)))
    sections.append(Section("Found with the right number", image=svg_uri(figure)))
    sections += [Section(title, table=Table(head, rows)) for title, head, rows in tables_of(figures)]
    with result_folder(out) as folder:
        plots.save(figure, folder / "rates.png")
        write_report(folder / "report.html", TITLE, lead_of(figures), sections)
        (folder / "index.md").write_text(markdown(figures), encoding="utf-8")
        write_json(folder / "data.json", figures)


_PICTURE = "rates.png"

RULE = (
    "The best figure wins, and all whose 95 % interval reaches into that of the best win with it. Corners carry no "
    "number and answer wherever something looks alike; they are shown and not ranked, nor is what fewer than ten cases "
    "say."
)


def lead_of(figures: ComparisonFigures) -> str:
    """Return what was measured, in words."""
    counts = ", ".join(f"{count} {name}" for name, count in figures.frames)
    return (
        f"Frames: {counts}; seed {figures.seed}. All designs hang in the same frames (640×480 px), each print on a "
        "square of the same area: a ring's ink has that area, an array's three markers stand in it, 0.4 of its side "
        "each, and SIFT's DoG and the disc, whose dots are a quarter as wide. Unless varied: side 48 px, no tilt, "
        "noise 2, blur 0.6 px. In render-tag's frames each print hangs alone, in the poses, the sizes (40…320 px) and "
        "with the Full HD camera of that benchmark's recipe locus_v1_tag36h11, drawn by our renderer. Libraries run "
        "with their defaults on one thread; ringgrid is made for whole lattices and is asked for single rings here, "
        "in every third frame. A "
        "print is found where its number is read within 0.15 sides or 2 px of its centre. Poses are from all prints of "
        "a design whose places on the board are known, ours by locate with its covariance, the others' by OpenCV's PnP "
        "from their corners or centres. Processor time also depends on what else the machine does to its caches."
    )


VERDICT_HEAD = ("question", "wins", "best of peakmark", "best of the others", "all who win")


def verdict_rows(figures: ComparisonFigures) -> list[tuple[str, str, str, str, str]]:
    """Return one row a question: who wins, the best of ours and of the others with intervals, and all winners."""
    ours = {reader.name for reader in figures.readers if reader.package == "peakmark"}
    rows = []
    for topic in figures.topics:
        own, others = (
            _first(topic, [f for f in ranked_of(topic.readers) if (f.reader in ours) is is_own])
            for is_own in (True, False)
        )
        rows.append((topic.question, _side(topic, ours), own, others, ", ".join(topic.best)))
    return rows


def _side(topic: Topic, ours: set[str]) -> str:
    """Return whether peakmark's readers win, others, or both are level; "–" without any winner."""
    sides = {name in ours for name in topic.best}
    return {(True,): "peakmark", (False,): "others", (False, True): "level"}.get(tuple(sorted(sides)), "–")


README_TOPICS = (
    "noise",
    "blur",
    "covered",
    "shadow",
    "small",
    "tilt",
    "false",
    "wrong",
    "centre",
    "pose",
    "position",
    "one print",
    "processor",
)
"""Questions of the README's table."""


def readme_table(figures: ComparisonFigures) -> str:
    """Return the README's table of which design when, in Markdown."""
    chosen = replace(figures, topics=tuple(topic for topic in figures.topics if topic.name in README_TOPICS))
    return markdown_table(VERDICT_HEAD[:-1], [row[:-1] for row in verdict_rows(chosen)])


def in_short(figures: ComparisonFigures) -> Iterator[tuple[str, str]]:
    """Yield who wins what, in words: questions that readers of peakmark win alone, share, and lose."""
    ours = {reader.name for reader in figures.readers if reader.package == "peakmark"}
    for title, side in (
        ("peakmark alone wins", "peakmark"),
        ("peakmark and others are level", "level"),
        ("others win", "others"),
    ):
        won = [topic.question for topic in figures.topics if _side(topic, ours) == side]
        yield title, "; ".join(won) or "nothing"


HONESTY = "Truths in the stated 95 % ellipsoid of the pose"


def honesty_rows(figures: ComparisonFigures) -> tuple[tuple[str, ...], list[tuple[str, ...]]] | None:
    """Return head and rows: each reader that states a covariance, by set of frames; None without any."""
    lines = [line for line in figures.lines if line.what == "inside"]
    readers = dict.fromkeys(figure.reader for line in lines for figure in line.readers)
    head = ("reader", *(f"{line.set} frames" for line in lines))
    rows = [(reader, *(_cell(line, reader) for line in lines)) for reader in readers]
    return (head, rows) if rows else None


def _first(topic: Topic, figures: Sequence[Figure]) -> str:
    if not figures:
        return "–"
    best = (max if topic.larger_is_better else min)(figures, key=lambda f: f.value or 0.0)
    return f"{best.reader} {shown(best, topic.unit)}"


def shown(figure: Figure, unit: str) -> str:
    """Return a figure with its interval, such as "93.1 % (91.2–94.6)"."""
    scale, digits = (100.0, 1) if unit == "%" else (1.0, {"px": 3, "‰": 2, "°": 3, "ms": 1}[unit])
    value, low, high = (
        None if x is None else f"{scale * x:.{digits}f}" for x in (figure.value, figure.low, figure.high)
    )
    return "–" if value is None else f"{value} {unit} ({low}–{high})"


def tables_of(figures: ComparisonFigures) -> Iterator[tuple[str, tuple[str, ...], list[tuple[str, ...]]]]:
    """Yield title, head and rows: a set's figures by reader, the sweeps' recall, and the readers themselves."""
    names = [reader.name for reader in figures.readers]
    for name, count in figures.frames:
        lines = [line for line in figures.lines if line.set == name and line.value is None]
        head = ("reader", *(WHAT[line.what] for line in lines))
        cells = [[_cell(line, reader) for line in lines] for reader in names]
        rows = [(reader, *row) for reader, row in zip(names, cells, strict=True) if set(row) != {"–"}]
        yield f"{name[0].upper()}{name[1:]} frames, {count}", head, rows
    for quantity in SWEEPS:
        lines = [line for line in figures.lines if line.quantity == quantity]
        if lines:
            head = (AXES[quantity], *names)
            rows = [(f"{line.value:g}", *(_cell(line, reader) for reader in names)) for line in lines]
            yield f"Found over {AXES[quantity]}", head, rows
    head = ("reader", "reads", "package", "version")
    yield "Readers", head, [(r.name, r.design, r.package, r.version) for r in figures.readers]


def _cell(line: Line, reader: str) -> str:
    found = [figure for figure in line.readers if figure.reader == reader]
    return shown(found[0], FIGURE_UNITS.get(line.what.partition("_")[0], "%")) if found else "–"


def markdown(figures: ComparisonFigures) -> str:
    """Return the page of the documentation, docs/figures/comparison/index.md; rates.png and data.json lie beside it."""
    parts = [
        f"# {TITLE}",
        lead_of(figures),
        f"Made by `{figures.command}`, which writes [data.json](data.json), too.",
        "## Who wins",
        "\n".join(f"- **{title}**: {text}." for title, text in in_short(figures)),
    ]
    parts += [RULE, markdown_table(VERDICT_HEAD, verdict_rows(figures))]
    if honesty := honesty_rows(figures):
        parts += [f"## {HONESTY}", "95 % is right; less says that poses are less exact than is claimed."]
        parts += [markdown_table(*honesty)]
    parts += ["## Found with the right number", f"![Rates over {', '.join(AXES.values())}]({_PICTURE})"]
    for title, head, rows in tables_of(figures):
        parts += [f"## {title}", markdown_table(head, rows)]
    return "\n\n".join(parts) + "\n"


@needs_extra
def rates_figure(figures: ComparisonFigures) -> Any:
    """Return the recall over each quantity, one panel each."""
    from matplotlib.figure import Figure as Canvas

    canvas = Canvas(figsize=(12, 9.5), layout="tight")
    for k, quantity in enumerate(SWEEPS):
        ax = canvas.add_subplot(3, 3, k + 1)
        lines = [line for line in figures.lines if line.quantity == quantity]
        values = [line.value or 0.0 for line in lines]
        for reader, style, colour in zip(figures.readers, _STYLES, _COLOURS, strict=True):
            rates = [100 * value_at(line, reader.name) for line in lines]
            ax.plot(values, rates, style, ms=4, lw=1.2, color=colour, label=reader.name)
        if quantity in ("side_px", "exposure"):
            ax.set_xscale("log")
            ax.set_xticks(values, [f"{value:g}" for value in values])
            ax.minorticks_off()
        ax.set(xlabel=AXES[quantity], ylim=(-3, 103), ylabel="found (%)" if k % 3 == 0 else "")
        ax.grid(alpha=0.3)
    handles, names = ax.get_legend_handles_labels()
    canvas.legend(handles, names, loc="lower right", bbox_to_anchor=(0.9, 0.08), ncols=2, frameon=False)
    return canvas
