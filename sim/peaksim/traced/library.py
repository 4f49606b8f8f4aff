"""Mitsuba 3 and the LLVM that it compiles its kernels with.

Mitsuba refuses LLVM 14 and older; 15 and 16, which OpenGL's drivers bring along, abort the whole process. So each
candidate is tried in a child process first (0.4 s). The scalar variants need no LLVM but are no fallback: they trace
one ray at a time, and with rays of our own each would be a call from Python.
"""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from glob import glob
from threading import RLock
from typing import Any, NamedTuple

from peaksim.area.bands import thread_count
from peaksim.errors import SceneError

LEAST_LLVM = 17
_VARIABLE = "DRJIT_LIBLLVM_PATH"
_FOLDERS = (
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm/lib/libLLVM.dylib",
)
_TRIAL = (
    "import mitsuba as mi; mi.set_variant('llvm_ad_mono'); import drjit as dr; "
    "assert dr.minimum(dr.arange(mi.Float, 16), 3).numpy().max() == 3"
)
_TRIAL_S = 60


class Tools(NamedTuple):
    """Mitsuba and Dr.Jit, which are imported when they are needed."""

    mi: Any
    """Mitsuba, in one of its variants."""
    dr: Any
    """Dr.Jit."""


_one_variant_at_a_time = RLock()


@contextmanager
def tools_for(channels: int) -> Iterator[Tools]:
    """Lend Mitsuba in its grey (1 channel) or RGB (3) variant, and set the variant from before afterwards.

    A variant is the whole process's, so threads wait for each other.

    Raises
    ------
    SceneError
        One line on what to install, where Mitsuba or a usable LLVM is missing.
    """
    with _one_variant_at_a_time:
        tools = _load()
        before = tools.mi.variant()
        tools.mi.set_variant("llvm_ad_mono" if channels == 1 else "llvm_ad_rgb")
        try:
            yield tools
        finally:
            if before is not None:
                tools.mi.set_variant(before)


@cache
def _load() -> Tools:
    if (reason := fault()) is not None:
        raise SceneError(f'renderer: "traced" {reason}')
    library = llvm_library()
    if library is not None:
        os.environ[_VARIABLE] = library
    import drjit
    import mitsuba

    drjit.set_thread_count(thread_count())
    return Tools(mitsuba, drjit)


def is_available() -> bool:
    """Return whether this machine can trace paths."""
    return fault() is None


@cache
def fault() -> str | None:
    """Return what is missing and how to install it, None if nothing is; asked once a process."""
    try:
        import mitsuba  # noqa: F401
    except ModuleNotFoundError:
        return "needs Mitsuba 3: pip install 'peakmark[traced]'"
    except (ImportError, NameError) as error:  # a NameError where libatomic is missing
        return (
            f"needs Mitsuba 3, which does not load ({str(error).splitlines()[0]}); Debian: apt-get install libatomic1"
        )
    if llvm_library() is None:
        given = os.environ.get(_VARIABLE)
        found = f"{_VARIABLE}={given} is none" if given else "found none"
        return f"needs LLVM {LEAST_LLVM} or newer, {found}; Debian: apt-get install libllvm19"
    return None


@cache
def llvm_library() -> str | None:
    """Return the path of an LLVM that works: the one that DRJIT_LIBLLVM_PATH states, or else the newest; or None."""
    given = os.environ.get(_VARIABLE)
    return next((path for path in ([given] if given else _candidates()) if _works(path)), None)


def _candidates() -> list[str]:
    """Return the libraries in the usual places, newest first, without those whose names say that they are too old."""
    libraries = {os.path.realpath(path): path for pattern in _FOLDERS for path in glob(pattern)}
    versions = {path: _version(path) for path in libraries}
    return sorted((path for path, version in versions.items() if version >= LEAST_LLVM), key=lambda p: -versions[p])


def _version(path: str) -> int:
    """Return the major version in the name of a library, such as libLLVM-19.so.1 or libLLVM.so.19.1; 99 without one."""
    found = re.search(r"libLLVM(?:-|\.so\.)(\d+)", os.path.basename(path))
    return int(found.group(1)) if found else 99


def _works(path: str) -> bool:
    """Return whether Mitsuba compiles and runs a kernel with a library, in a child process that may crash."""
    with tempfile.TemporaryDirectory() as home:  # away from the cache of compiled kernels
        done = subprocess.run(
            [sys.executable, "-c", _TRIAL],
            env={**os.environ, _VARIABLE: path, "HOME": home},
            capture_output=True,
            timeout=_TRIAL_S,
            check=False,
        )
    return done.returncode == 0
