"""Hatch's build hook: `pip install` compiles the kernels, and a wheel carries them and the name of its platform.

PEAKMARK_TARGET names another system to make a wheel for, see `build_native.TARGETS`.
"""

import os
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).resolve().parent))

from build_native import LIBRARY, OBJECTS, TARGETS, ZIG, build, system_compiler, system_name


class NativeHook(BuildHookInterface):
    """Compiles the library before a wheel is packed or an editable install is made."""

    def dependencies(self) -> list[str]:
        """Return the compiler to install from pip, if the system has none for the target."""
        target = os.environ.get("PEAKMARK_TARGET")
        return [ZIG] if target or system_compiler() is None else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and tell Hatch where the library is and which platform it is for."""
        if self.target_name != "wheel":
            return
        named = os.environ.get("PEAKMARK_TARGET")
        target = named or system_name()
        folder = LIBRARY if version == "editable" else OBJECTS / target
        build(folder, target, with_zig=named is not None)
        build_data["pure_python"] = False
        platform = TARGETS[named][1] if named else sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["tag"] = f"py3-none-{platform}"
        if version != "editable":
            build_data["force_include"][str(folder)] = "peaksim/_native"
