"""The core on a system without POSIX: what only POSIX has is hidden, and Windows's lock is stood in for.

That it runs on Windows itself is not shown here; that nothing of the core needs what Windows lacks is.
"""

import os
import subprocess
import sys
from pathlib import Path

from tests.places import SOURCES

CODE = r"""
import sys, types, pkgutil, importlib, os, signal
import cv2, fpdf, numpy, PIL.Image, pydantic, rich.console, rich.progress, scipy.optimize, typer, typer.main, yaml
import asyncio, concurrent.futures.process, ctypes.util, multiprocessing.connection, multiprocessing.pool, socket
import subprocess, tempfile  # the standard library is its own system's
held = set()
msvcrt = types.ModuleType("msvcrt")
msvcrt.LK_NBLCK = 2
def locking(descriptor, mode, count):
    name = os.readlink(f"/proc/self/fd/{descriptor}")
    if any(os.path.exists(f"/proc/self/fd/{d}") and n == name and d != descriptor for d, n in held):
        raise PermissionError(13, "Permission denied")
    held.add((descriptor, name))
msvcrt.locking = locking
sys.modules["msvcrt"] = msvcrt
for name in ("fcntl", "grp", "pwd", "resource", "termios", "tty", "pty", "OpenGL", "av", "jinja2", "matplotlib",
             "pyarrow", "pyrender", "trimesh", "mitsuba", "sklearn", "skimage", "evo", "pandas", "distributed"):
    sys.modules[name] = None
for module, names in ((signal, ("SIGHUP", "SIGKILL", "SIGALRM", "SIGUSR1")),
                      (os, ("O_DIRECTORY", "O_NOFOLLOW", "fchmod", "fork", "killpg", "getuid", "sched_getaffinity",
                            "register_at_fork", "WNOHANG", "O_NONBLOCK", "sysconf", "statvfs", "mkfifo"))):
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
import peakmark, peaksim, peaksim.native_library as library
named = library.system_name()
library.system_name = lambda: named
system, sys.platform = sys.platform, "win32"
failed = []
for package in (peaksim, peakmark):
    for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if found.name not in NO_MODULES:
            try:
                importlib.import_module(found.name)
            except Exception as error:
                failed.append(f"{found.name}: {error!r}")
from pathlib import Path
from peakmark.report.results import peak_memory_mb, result_folder
from peaksim.corpus.store.folder import FolderStore
out = Path(sys.argv[1])
with result_folder(out / "results") as stage:
    (stage / "a.txt").write_text("x")
store = FolderStore(str(out / "corpus"), new=True)
with store.alone(), store.create("a.txt") as file:
    file.write(b"x")
    other = FolderStore(str(out / "corpus"), new=False)
    try:
        with other.alone():
            failed.append("two runs hold one folder")
    except ValueError as error:
        assert "no other run" in str(error)
assert peak_memory_mb() is None
sys.platform = system
peakmark.identify(numpy.eye(64, dtype=numpy.uint8) * 255)
print(*failed, sep="\n")
from peakmark.cli.command import run_command
del sys.argv[1:]
run_command(lambda: None)
"""
NO_MODULES = {"peakmark.cli.__main__", "peakmark.regress.detector_watcher"}
"""They run when imported, and as a program of POSIX systems, which `regress` with a program as detector needs."""


def test_the_core_imports_writes_and_identifies_without_posix(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"NO_MODULES = {NO_MODULES!r}\n{CODE}", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": SOURCES, "TMPDIR": str(tmp_path)},
    )
    assert (done.returncode, done.stdout.strip()) == (0, ""), done.stderr + done.stdout
    assert (tmp_path / "results" / "a.txt").is_file()
    assert (tmp_path / "corpus" / "a.txt").is_file()
