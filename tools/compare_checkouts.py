"""Run the main jobs in two checkouts and compare what they write: figures of every JSON, bytes of every other file.

    git worktree add ../before HEAD~1
    python tools/compare_checkouts.py ../before . --out ../compared [--only floor --only corpus]

A job whose output is there already is not run again, so that one side can stand while the other changes.
Times, memory and versions are left out, and numbers may differ by rounding (1e-7); any other difference is listed, and
the exit status is then 1.
"""

import argparse
import csv
import hashlib
import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

CORPUS = ["-m", "peakmark.cli", "corpus", "make", "scenes/experiments/corpus_small.toml", "--frames", "40"]
JOBS = {
    "floor": ["scripts/render_floor.py", "--renderer", "exact"],
    "floor-gl": ["scripts/render_floor.py", "--renderer", "gl"],
    "cave": ["scripts/render_cave.py"],
    "walk": ["scripts/render_cave.py", "--frames", "3"],
    "flight": ["scripts/render_floor.py", "--trajectory", "stroll", "--frames", "8", "--renderer", "exact"],
    "drive": ["scripts/drive_floor.py", "--paths", "1", "--length", "2", "--renderer", "exact"],
    "flights": ["scripts/evaluate_flights.py", "--first", "2", "--frames", "6"],
    "evaluate-cave": ["scripts/evaluate_cave.py", "--rooms", "2", "--views", "3", "--size", "0.5"],
    "dense-wall": ["scripts/dense_wall.py"],
    "designs": ["scripts/compare_designs.py", "--quick"],
    "classifier": ["scripts/train_classifier.py", "--training-rooms", "2", "--held-out-rooms", "1", "--views", "1"],
    "detectability": ["scripts/detectability.py", "--trials", "2", "--every", "8"],
    "corpus": CORPUS,
    "regress-floor": ["scripts/regress.py", "run", "floor", "--quick"],
    "regress-cave": ["scripts/regress.py", "run", "cave", "--quick"],
}
VOLATILE = re.compile(r"seconds|(time|load|cpu|spent)_s\b|_ms$|frames_per_second|memory|_mb\b|versions|points_s\b")
"""Paths and columns that a clock or the machine decides."""
ROUNDING = 1e-7
"""Relative difference of two figures that counts as none."""

TEXT_OF_TIMES = {".html", ".md", ".xml", ".mp4"}
"""Written with times in them, or by an encoder: whether they are there is compared, their bytes are not."""


def run_job(checkout: Path, words: list[str], out: Path) -> None:
    """Run one job of a checkout with its own sources; its output appears in `out` when it has ended well."""
    paths = os.pathsep.join(str(checkout / root) for root in ("src", "sim"))
    print(f"{out}: {' '.join(words)}", flush=True)
    stage = out.with_name(out.name + ".unfinished")
    subprocess.run(
        [sys.executable, *words, "--out", str(stage), "--quiet"],
        cwd=checkout,
        env={**os.environ, "PYTHONPATH": paths},
        check=True,
    )
    stage.rename(out)


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every plain value of a JSON document with its path, without those that a clock decides."""
    if VOLATILE.search(path):
        return
    if isinstance(value, dict):
        for key, part in value.items():
            yield from leaves(part, f"{path}/{key}")
    elif isinstance(value, list):
        for index, part in enumerate(value):
            yield from leaves(part, f"{path}/{index}")
    else:
        yield path, value


def content(path: Path) -> Any:
    """Return what of a file is compared."""
    if path.suffix in TEXT_OF_TIMES:
        return "there"
    if path.suffix == ".json":
        return dict(leaves(json.loads(path.read_text(encoding="utf-8"))))
    if path.suffix == ".jsonl":
        lines = path.read_text(encoding="utf-8").splitlines()
        return dict(leaves([json.loads(line) for line in lines]))
    if path.suffix == ".csv":
        with path.open(encoding="utf-8", newline="") as file:
            return dict(leaves([{name: as_number(text) for name, text in row.items()} for row in csv.DictReader(file)]))
    return hashlib.sha256(path.read_bytes()).hexdigest()


def as_number(text: str) -> float | str:
    """Return a cell's number, or the cell where it is none."""
    try:
        return float(text)
    except ValueError:
        return text


def differences(before: Path, after: Path) -> Iterator[str]:
    """Yield a line for every file, and in JSON every value, that differs between two folders."""
    names = {str(p.relative_to(root)) for root in (before, after) for p in root.rglob("*") if p.is_file()}
    for name in sorted(names):
        one, other = before / name, after / name
        if not (one.is_file() and other.is_file()):
            yield f"{name}: only {'before' if one.is_file() else 'after'}"
            continue
        old, new = content(one), content(other)
        if old == new:
            continue
        if not isinstance(old, dict):
            yield f"{name}: other bytes"
            continue
        for key in sorted({*old, *new}):
            was, now = old.get(key, "absent"), new.get(key, "absent")
            if not is_same(was, now):
                yield f"{name}: {key}: {was} → {now}"


def is_same(was: Any, now: Any) -> bool:
    """Return whether two plain values are equal, numbers but for rounding in another order."""
    if isinstance(was, float) and isinstance(now, float):
        return math.isclose(was, now, rel_tol=ROUNDING)
    return bool(was == now)


def main() -> int:
    """Run what is missing, compare all, print a line a job."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, help="checkout of the earlier state")
    parser.add_argument("after", type=Path, help="checkout of the later state")
    parser.add_argument("--out", type=Path, required=True, help="folder for both sides' results")
    parser.add_argument("--only", action="append", choices=sorted(JOBS), help="jobs to run; all without it")
    words = parser.parse_args()
    is_equal = True
    for name in words.only or JOBS:
        sides = [(words.before, words.out / "before" / name), (words.after, words.out / "after" / name)]
        for checkout, out in sides:
            if not out.exists():
                out.parent.mkdir(parents=True, exist_ok=True)
                run_job(checkout.resolve(), JOBS[name], out.resolve())
        lines = list(differences(sides[0][1], sides[1][1]))
        files = sum(p.is_file() for p in sides[0][1].rglob("*"))
        print(
            f"{name}: {'equal' if not lines else f'{len(lines)} differences'}, {files} files", *lines[:40], sep="\n  "
        )
        is_equal = is_equal and not lines
    return 0 if is_equal else 1


if __name__ == "__main__":
    sys.exit(main())
