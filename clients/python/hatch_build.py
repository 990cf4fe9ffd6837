"""Adds the program to the wheel if ``BALLAST_PROGRAM`` names its binary. That wheel installs the service and the
client. Without the variable the wheel contains only the client, for any platform."""

from __future__ import annotations

import os
import platform
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class ProgramHook(BuildHookInterface):  # type: ignore[type-arg]
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        named = os.environ.get("BALLAST_PROGRAM")
        if not named:
            return
        program = Path(named)
        if not (program.is_absolute() and program.is_file()):
            raise ValueError(f"BALLAST_PROGRAM is {named!r}: must be the absolute path of the binary")
        build_data["shared_scripts"][str(program)] = program.name
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{_platform()}"


def _platform() -> str:
    """Returns the platform tag of the program, which needs the C library of this machine or a later one."""
    name, version = platform.libc_ver()
    if name == "glibc":
        return f"manylinux_{version.replace('.', '_')}_{platform.machine()}"
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")
