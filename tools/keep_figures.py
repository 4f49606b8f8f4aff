"""Make the data files of the pages of figures again: run each one's command, and keep its result.

    python tools/keep_figures.py                    # all of them: hours
    python tools/keep_figures.py cave dense_wall    # these

writes docs/figures/data/NAME.json: the command, then its result.json without times, memory and the machine's OpenGL.
`tests/test_figures.py` compares the pages with these files.
"""

import argparse
import json
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "docs" / "figures" / "data"

PHASES = (
    "--only scale --only turn --only contrast --only exposure --only vignetting --only jpeg --only defocus "
    "--only motion --only bias --only background"
)
"""Experiments whose tables the page has."""

COMMANDS = {
    "floor": "peakmark floor --renderer gl",
    "floor_preset_paper": "peakmark floor --renderer gl --preset paper",
    "floor_sift": "peakmark floor --renderer gl --marker sift",
    "floor_sift_stretch_1": "peakmark floor --renderer gl --marker sift --stretch 1",
    "cave": "peakmark cave",
    "cave_sift": "peakmark cave --marker sift",
    "cave_rule_paper": "peakmark cave --rule paper",
    "dense_wall": "python scripts/dense_wall.py",
    "poses": "python scripts/evaluate_poses.py --traced 16 --seed 7",
    "calibration": "python scripts/evaluate_calibration.py --views 15",
    "detectability": f"python scripts/detectability.py {PHASES}",
    "detectability_paper": "python scripts/detectability.py --paper",
    "centers": "python scripts/evaluate_centers.py --views 5 --seed 1",
    "kinds": "python scripts/compare_kinds.py --place floors --place rooms --frames 40 --seed 2",
}
"""Data file → what makes it."""

OF_THE_MACHINE = ("time_s", "load_s", "peak_memory_mb", "gl_renderer", "remarks")


def kept(result: dict[str, Any], command: str) -> dict[str, Any]:
    """Return what is kept of a result."""
    return {"command": command} | {name: value for name, value in result.items() if name not in OF_THE_MACHINE}


def run(command: str, out: Path) -> dict[str, Any]:
    """Run a command of `COMMANDS` and return its result; a command that fails is a CalledProcessError."""
    program, *arguments = shlex.split(command)
    start = ["-m", "peakmark.cli"] if program == "peakmark" else []
    subprocess.run([sys.executable, *start, *arguments, "--out", str(out), "--quiet"], cwd=ROOT, check=True)
    result: dict[str, Any] = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return result


def main() -> None:
    """Make the files that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[[], *COMMANDS], metavar="NAME", help=", ".join(COMMANDS))
    for name in parser.parse_args().names or COMMANDS:
        with tempfile.TemporaryDirectory() as folder:
            result = kept(run(COMMANDS[name], Path(folder)), COMMANDS[name])
        text = json.dumps(result, indent=1, ensure_ascii=False)
        (DATA / f"{name}.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
