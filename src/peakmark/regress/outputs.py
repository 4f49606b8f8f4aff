"""A comparison for machines and people: JUnit XML for CI services, Markdown, and plain values."""

from typing import Any
from xml.etree import ElementTree

from peakmark.errors import one_line
from peakmark.regress.compare import CONFIDENCE, FAULTS, Change, Comparison

SIGNS = {"better": "▲", "same": "=", "worse": "▼", "changed": "≠", "unknown": "–"}


def junit_xml(comparison: Comparison) -> bytes:
    """Return JUnit's XML: one test case a metric, failed where it got worse or changed, skipped where unknown."""
    name = one_line(comparison.after.suite)  # XML has no escapes for control characters
    suite = ElementTree.Element(
        "testsuite",
        {
            "name": f"peakmark.regress.{name}",
            "tests": str(len(comparison.changes)),
            "failures": str(len(comparison.faults)),
            "skipped": str(sum(change.verdict == "unknown" for change in comparison.changes)),
            "errors": "0",
        },
    )
    for change in comparison.changes:
        names = {"classname": name, "name": change.metric.key}
        case = ElementTree.SubElement(suite, "testcase", names)
        if change.verdict in FAULTS:
            words = sentence(change)
            ElementTree.SubElement(case, "failure", {"message": words, "type": change.verdict}).text = words
        elif change.verdict == "unknown":
            ElementTree.SubElement(case, "skipped", {"message": "nothing to compare"})
    root = ElementTree.Element("testsuites")
    root.append(suite)
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def sentence(change: Change) -> str:
    """Return a change in words, with the frames that show it."""
    where = f"; see frames {', '.join(map(str, change.frames))}" if change.frames else ""
    return (
        f"{change.metric.key}: {number(change.before)} → {number(change.after)} {change.metric.unit}".rstrip()
        + f" ({change_text(change)}, tolerance {tolerance_text(change)}): {change.verdict}{where}"
    )


def markdown(comparison: Comparison) -> str:
    """Return a summary for a pull request: what was tested, the table, the frames that show faults."""
    after, faults = comparison.after, comparison.faults
    verdict = f"{len(faults)} of {len(comparison.changes)} figures got worse or changed" if faults else "no regression"
    lines = [
        f"## {escaped(after.suite)}: {verdict}",
        "",
        f"Detector `{escaped(after.detector.name)}` on {len(after.results)} frames, seed {after.seed}.",
    ]
    if comparison.images_changed:
        lines.append(f"The pixels of {comparison.images_changed} frames differ from the baseline's.")
    lines += ["", "| | figure | before | after | change | tolerance |", "|---|---|---:|---:|---:|---:|"]
    for change in comparison.changes:
        sign, key, *values = cells_of(change)
        title = f"{key} ({change.metric.unit})" if change.metric.unit else key
        lines.append(f"| {' | '.join(map(escaped, (sign, title, *values)))} |")
    lines += ["", *(f"- {escaped(sentence(change))}" for change in faults)]
    return "\n".join(lines).rstrip() + "\n"


def escaped(text: str) -> str:
    """Return text that Markdown and HTML show as it is."""
    for character in "&<>|`[":
        text = text.replace(character, f"&#{ord(character)};") if character != "&" else text.replace("&", "&amp;")
    return one_line(text)


def cells_of(change: Change) -> tuple[str, ...]:
    """Return a table's row: sign, figure, before, after, change with its interval, tolerance."""
    values = (number(change.before), number(change.after), change_text(change), tolerance_text(change))
    return SIGNS[change.verdict], change.metric.key, *values


def number(value: float | None) -> str:
    """Return a figure with at most four significant digits."""
    return "–" if value is None else f"{value:.4g}"


def change_text(change: Change) -> str:
    """Return a change with its interval."""
    if change.change is None:
        return "–"
    if change.interval is None:
        return _amount(change.change, change.metric.relative)
    low, high = (_amount(limit, change.metric.relative) for limit in change.interval)
    return f"{_amount(change.change, change.metric.relative)} [{low}, {high}]"


def tolerance_text(change: Change) -> str:
    """Return a metric's tolerance."""
    return f"{100 * change.metric.tolerance:g} %" if change.metric.relative else f"{change.metric.tolerance:g}"


def _amount(value: float, relative: bool) -> str:
    return f"{100 * value:+.3g} %" if relative else f"{value:+.3g}"


def plain(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as plain values for result.json."""
    return {
        "suite": comparison.after.suite,
        "frames": len(comparison.after.results),
        "regression": bool(comparison.faults),
        "pictures_changed": comparison.images_changed,
        "confidence": CONFIDENCE,
        "changes": [_plain_change(change) for change in comparison.changes],
    }


def _plain_change(change: Change) -> dict[str, Any]:
    metric, interval = change.metric, change.interval
    return {
        **{name: getattr(metric, name) for name in ("key", "unit", "direction", "tolerance", "relative")},
        **{name: finite(getattr(change, name)) for name in ("before", "after", "change")},
        "interval": None if interval is None else [finite(limit) for limit in interval],
        "verdict": change.verdict,
        "frames": list(change.frames),
    }


def finite(value: float | None) -> float | None:
    """Return a number that JSON has, None for the others."""
    return value if value is not None and abs(value) < float("inf") else None
