"""Build everything that a release uploads into dist/, check it, and try what fits this machine: `make release`.

The source distribution and the wheels for all systems are built; twine and check-wheel-contents read them; what can be
installed here is installed into an empty environment each, where tools/smoke_test.py runs away from the checkout.
Prints a table of sizes and results. Exit status 1 if anything failed.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"

sys.path.insert(0, str(ROOT / "tools"))

from build_native import TARGETS, system_name  # noqa: E402 — a script beside this one


@dataclass(frozen=True)
class Row:
    """One file of a release."""

    file: Path
    checks: str
    smoke: str


def run(*words: object, cwd: Path = ROOT, target: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run a program without what this checkout adds to Python's path; its output is kept."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PEAKSIM_NATIVE", "PEAKMARK_TARGET")}
    environment |= {"PEAKMARK_TARGET": target} if target else {}
    command = [str(word) for word in words]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)


def build() -> list[Path]:
    """Build the source distribution and the wheels; return their files. A failed build ends the program."""
    shutil.rmtree(DIST, ignore_errors=True)
    done = [run(sys.executable, "-m", "build", "--sdist", "--outdir", DIST)]
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps")
    done += [run(*pip, "--wheel-dir", DIST, ROOT, target=target) for target in TARGETS]
    for one in done:
        if one.returncode:
            sys.exit(f"release: {' '.join(one.args)}\n{one.stdout}{one.stderr}")
    return sorted(DIST.iterdir())


def checked(file: Path) -> str:
    """Return "ok", or what twine and check-wheel-contents say of a file."""
    programs = [(sys.executable, "-m", "twine", "check", "--strict", file)]
    if file.suffix == ".whl":
        programs.append((sys.executable, "-m", "check_wheel_contents", file))
    said = [one.stdout + one.stderr for one in (run(*program) for program in programs) if one.returncode]
    return " ".join(" ".join(said).split()) or "ok"


def tried(file: Path, extra: str = "") -> str:
    """Return what the smoke test says of a file, installed into an empty environment; "–" where it does not fit."""
    if file.suffix == ".whl" and TARGETS[system_name()][1] not in file.name:
        return "–"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(sys.executable, "-m", "venv", folder / "venv")
        python = folder / "venv" / "bin" / "python"
        wanted = f"{file}[{extra}]" if extra else str(file)
        installed = run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wanted, cwd=folder)
        if installed.returncode:
            return f"pip: {installed.stderr.strip()[-300:]}"
        smoke = ROOT / "tools" / "smoke_test.py"
        done = run(python, "-I", smoke, folder / "out", *([extra] if extra else []), cwd=folder)
        return "ok" if done.returncode == 0 else f"failed: {done.stderr.strip()[-300:]}"


def main() -> int:
    """Do all of it; return the exit status."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    rows = [Row(file, checked(file), tried(file)) for file in build()]
    print(f"peakmark {project['version']}\n\n| file | size | twine, check-wheel-contents | smoke test |")
    print("|---|---|---|---|")
    for row in rows:
        print(f"| {row.file.name} | {row.file.stat().st_size / 1e6:.2f} MB | {row.checks} | {row.smoke} |")
    missing = {"Homepage", "Source", "Documentation"} - set(project.get("urls", {}))
    if missing:
        print(f"\npyproject.toml, project.urls: {', '.join(sorted(missing))} to be filled in before an upload")
    return 0 if all(row.checks == "ok" and row.smoke in ("ok", "–") for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
