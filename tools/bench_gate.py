"""Compare the speed of a checkout with that of the commit that it branched from, in one run: `make bench-gate`.

    python tools/bench_gate.py [--base REF] [--rounds 7]

Both do the jobs of `benchmarks/gate_jobs.py`, alternating, each round in new processes. A job fails where the 95 %
interval of the median ratio of processor times, this one's over the base's, lies above `SLOWER`. Exit status 1 then.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
JOBS = ROOT / "benchmarks" / "gate_jobs.py"

SLOWER = 1.1
"""Ratio from which a job is slower: two runs of one commit differ by up to 5 % on a machine with other work."""

RESAMPLES = 2000


Times = Mapping[str, float]


def judged(base: Sequence[Times], head: Sequence[Times]) -> list[tuple[str, float, float, float, bool]]:
    """Return job, median ratio of paired rounds, its bootstrap interval, and whether it is slower, for each job."""
    rng, rows = np.random.default_rng(0), []
    for name in head[0]:
        if name not in base[0]:
            continue
        ratios = np.array([h[name] / b[name] for b, h in zip(base, head, strict=True)])
        drawn = np.median(ratios[rng.integers(len(ratios), size=(RESAMPLES, len(ratios)))], axis=1)
        low, high = np.percentile(drawn, [2.5, 97.5])
        rows.append((name, float(np.median(ratios)), float(low), float(high), bool(low > SLOWER)))
    return rows


def measured(checkout: Path) -> dict[str, float]:
    """Return the times of a checkout's jobs."""
    paths = os.pathsep.join(str(checkout / root) for root in ("src", "sim"))
    environment = {**os.environ, "PYTHONPATH": paths, "PEAKSIM_NATIVE": ""}
    done = subprocess.run([sys.executable, str(JOBS)], env=environment, capture_output=True, text=True, check=True)
    times: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return times


def main() -> int:
    """Measure, print, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--base", default="main", help="where this checkout branched from: the merge base with it")
    parser.add_argument("--rounds", type=int, default=7)
    asked = parser.parse_args()
    found = subprocess.run(
        ["git", "-C", str(ROOT), "merge-base", asked.base, "HEAD"], capture_output=True, text=True, check=False
    )
    if found.returncode:
        print(f"error: --base: expected a commit to compare with, got {asked.base!r}", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        checkout = Path(folder, "base")
        tree = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*tree, "add", "-q", "--detach", str(checkout), found.stdout.strip()], check=True)
        try:
            subprocess.run([sys.executable, str(checkout / "tools" / "build_native.py")], check=True)
            rounds = [(measured(checkout), measured(ROOT)) for _ in range(asked.rounds)]
        finally:
            subprocess.run([*tree, "remove", "--force", str(checkout)], check=True)
    rows = judged([base for base, _ in rounds], [head for _, head in rounds])
    for name, ratio, low, high, is_slower in rows:
        print(f"{'SLOWER' if is_slower else 'ok':6}  {name:32} × {ratio:.3f} ({low:.3f}–{high:.3f})")
    return int(any(row[-1] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
