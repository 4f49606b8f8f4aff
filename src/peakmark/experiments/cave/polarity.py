"""Dark or light: the sign of the Laplacian against the signature, under conditions hard enough that both fail.

The paper found the Laplacian more reliable (Section 4.2). Each image shows one marker on white paper before a
photograph; the strongest key point of about its size near its true centre is asked both ways.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import get_args

import numpy as np

from peakmark import surf
from peakmark.experiments.detectability.conditions import Condition, render_image
from peakmark.identification.detection import SIDE_OF_SCALE, is_polarity
from peakmark.identification.signature import polarity_by_signature
from peakmark.markers.patterns import Polarity
from peakmark.report.page import Section, Table, write_report
from peakmark.report.results import result_folder, write_json
from peakmark.score.statistics import Rate, rate

PHOTOGRAPHS = ("gravel", "brick", "grass")
"""Behind the markers, one after another."""

_NEAR_SIDES, _SIZE_RATIO = 0.15, 1.5
"""A key point is the marker's if it is so near its centre, in sides, and of its size within this factor."""

_USUAL = Condition(side_px=40.0, image_px=161, background=PHOTOGRAPHS[0])
CONDITIONS: dict[str, tuple[Condition, ...]] = {
    "side (px)": tuple(replace(_USUAL, side_px=side) for side in (40.0, 20.0, 16.0, 14.0, 12.0)),
    "tilt (°)": tuple(replace(_USUAL, tilt_deg=tilt) for tilt in (45.0, 60.0, 70.0, 75.0, 80.0)),
    "noise σ": tuple(replace(_USUAL, noise=noise) for noise in (25.0, 50.0, 75.0, 100.0)),
    "defocus (px)": tuple(replace(_USUAL, defocus_px=radius) for radius in (4.0, 8.0, 12.0, 16.0)),
    "motion (px)": tuple(replace(_USUAL, motion_px=length) for length in (10.0, 20.0, 30.0)),
    "print's contrast, noise σ 10": tuple(replace(_USUAL, contrast=share, noise=10.0) for share in (0.3, 0.1, 0.05)),
}
"""By what is varied; the value is the field's."""

_FIELDS = ("side_px", "tilt_deg", "noise", "defocus_px", "motion_px", "contrast")


@dataclass(frozen=True)
class PolarityRow:
    """Dark and light markers under one condition."""

    varied: str
    value: float
    """What is varied, and how far."""
    images: int
    found: int
    """Images, and those with a key point that is the marker's."""
    wrong_by_laplacian: Rate
    wrong_by_signature: Rate
    """Of those."""


def compare_polarity(trials: int, seed: int, on_row: Callable[[], None] = lambda: None) -> list[PolarityRow]:
    """Return a row a condition, of so many images of each polarity; `on_row` is called after each."""
    rows = []
    for (varied, conditions), name in zip(CONDITIONS.items(), _FIELDS, strict=True):
        for condition in conditions:
            outcomes = [
                told_polarities(condition, polarity, seed, trial)
                for polarity in get_args(Polarity)
                for trial in range(trials)
            ]
            found = [one for one in outcomes if one is not None]
            by_laplacian, by_signature = (rate(sum(not one[k] for one in found), len(found)) for k in (0, 1))
            value = float(getattr(condition, name))
            rows.append(PolarityRow(varied, value, len(outcomes), len(found), by_laplacian, by_signature))
            on_row()
    return rows


def told_polarities(condition: Condition, polarity: Polarity, seed: int, trial: int) -> tuple[bool, bool] | None:
    """Return whether Laplacian and signature tell one image's polarity rightly; None where the marker is not found."""
    shown = replace(condition, marker=f"surf-{polarity}", background=PHOTOGRAPHS[trial % len(PHOTOGRAPHS)])
    view = render_image(shown, np.random.default_rng([seed, _key(shown), trial]))
    features = surf.detect(view.image)
    gaps = np.linalg.norm(features.xy - view.center_xy, axis=1)
    ratios = SIDE_OF_SCALE * features.scale / view.side_px
    near = (gaps <= _NEAR_SIDES * view.side_px) & (np.abs(np.log(ratios)) <= np.log(_SIZE_RATIO))
    if not near.any():
        return None
    strongest = features[np.flatnonzero(near)[:1]]
    descriptors = surf.describe(view.image, strongest)
    return bool(is_polarity(strongest, polarity)[0]), polarity_by_signature(descriptors) == [polarity]


@cache
def _key(condition: Condition) -> int:
    return int.from_bytes(sha256(repr(condition).encode()).digest()[:8], "big")


def totals(rows: list[PolarityRow]) -> tuple[int, int, int]:
    """Return how many markers were found, and how many of them Laplacian and signature told wrongly."""
    wrong = [sum(getattr(row, name).count for row in rows) for name in ("wrong_by_laplacian", "wrong_by_signature")]
    return sum(row.found for row in rows), wrong[0], wrong[1]


def polarity_table(rows: list[PolarityRow]) -> Table:
    """Return a line a condition."""
    head = ("varied", "value", "images", "found", "wrong by Laplacian", "wrong by signature")
    lines = [
        (row.varied, row.value, row.images, row.found, _text(row.wrong_by_laplacian), _text(row.wrong_by_signature))
        for row in rows
    ]
    return Table(head, lines)


def _text(wrong: Rate) -> str:
    if wrong.value is None or wrong.low is None or wrong.high is None:
        return "–"
    return f"{100 * wrong.value:.1f} % ({100 * wrong.low:.1f}–{100 * wrong.high:.1f})"


def write_polarity(rows: list[PolarityRow], trials: int, seed: int, out: str | Path) -> None:
    """Write report.html and result.json."""
    found, by_laplacian, by_signature = totals(rows)
    lead = (
        f"Of {found:,} markers that SURF found, the sign of the Laplacian told {by_laplacian} wrongly and the "
        f"signature {by_signature}; {trials} images of each polarity a condition, seed {seed}, intervals are Wilson's "
        f"at 95 %. "
        f"Side 40 px, squarely and sharply seen, unless varied."
    )
    with result_folder(out) as folder:
        sections = [Section("Conditions", table=polarity_table(rows))]
        write_report(folder / "report.html", "Dark or light: Laplacian against signature", lead, sections)
        write_json(folder / "result.json", {"trials": trials, "seed": seed, "rows": [asdict(row) for row in rows]})
