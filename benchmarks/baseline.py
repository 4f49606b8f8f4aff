"""Ratios of this run beside those of `baseline.json`."""

import json
from pathlib import Path

from rich.console import Console
from rich.table import Table

PATH = Path(__file__).with_name("baseline.json")
TOLERANCE = 0.15
"""Ratios that differ by less are the same."""
Ratios = dict[str, float]


def compare(console: Console, ratios: Ratios, *, update: bool) -> None:
    """Print each ratio beside the baseline's; write them there if asked to."""
    baseline = json.loads(PATH.read_text(encoding="utf-8")) if PATH.exists() else {}
    console.print(comparison(ratios, baseline))
    if update:
        PATH.write_text(json.dumps(baseline | ratios, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def comparison(ratios: Ratios, baseline: Ratios) -> Table:
    """Each ratio beside the baseline's."""
    table = Table(title="against the baseline (their time over ours; more is better)", title_justify="left")
    for column in ("", "now", "baseline", "verdict"):
        table.add_column(column, justify="right" if column in ("now", "baseline") else "left")
    for key, now in ratios.items():
        before = baseline.get(key)
        table.add_row(key, f"{now:.2f}", "–" if before is None else f"{before:.2f}", verdict(now, before))
    return table


def verdict(now: float, before: float | None) -> str:
    """Say better, same or worse; new where the baseline has none."""
    if before is None:
        return "new"
    if abs(now / before - 1) <= TOLERANCE:
        return "same"
    return "better" if now > before else "worse"
