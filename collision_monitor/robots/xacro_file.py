"""xacro files: the URDF that the program `xacro` makes of one, in a process of its own.

xacro evaluates expressions of the file as Python, so such a file is a program: use only your own.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from collision_monitor.errors import InputError
from collision_monitor.settings.regular_file import found_instead, read_regular
from collision_monitor.settings.xml_tree import LARGEST_TEXT

ENDING: Final = ".xacro"

LONGEST: Final = 30.0
"""s. The largest public robots take 2 s."""

MOST_MEMORY: Final = 2 << 30
"""Bytes of address space of the process."""

_MODULE: Final = (sys.executable, "-P", "-c", "import xacro; xacro.main()")
_HOW: Final = "`pip install xacro`, source a ROS 2 install that has it, or convert the file: `xacro FILE > ROBOT.urdf`"


def expand_xacro(path: Path, arguments: Mapping[str, str], packages: Mapping[str, Path]) -> bytes:
    """Return the URDF of a xacro file with values of its arguments (xacro:arg); packages: folders for `$(find NAME)`.

    Raises InputError with what xacro prints, and where no xacro is there.
    """
    if found := found_instead(path):
        raise InputError(f"{path}: expected a xacro file, got {found}")
    program = _program(path)
    given = [f"{name}:={value}" for name, value in arguments.items()]
    with tempfile.TemporaryDirectory() as folder:
        prefixes = [_prefix(Path(folder), packages), os.environ.get("AMENT_PREFIX_PATH", "")]
        environment = {**os.environ, "AMENT_PREFIX_PATH": os.pathsep.join(filter(None, prefixes))}
        output = Path(folder) / "robot.urdf"
        with subprocess.Popen(
            [*program, str(path.resolve()), *given, "-o", str(output)],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment,
        ) as process:  # fmt: skip
            with suppress(ProcessLookupError):  # it has ended already
                resource.prlimit(process.pid, resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
                resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (LARGEST_TEXT, LARGEST_TEXT))
            try:
                said = process.communicate(timeout=LONGEST)[1].decode(errors="replace").strip()
            except subprocess.TimeoutExpired:
                process.kill()
                raise InputError(f"{path}: expected xacro to end within {LONGEST:g} s, got no end") from None
        if process.returncode or not output.exists():
            reason = " ".join(said.split()) or f"exit code {process.returncode}"
            raise InputError(f"{path}: expected a file that xacro can read, got: {reason:.500}")
        return read_regular(output, most=LARGEST_TEXT)


def _program(path: Path) -> tuple[str, ...]:
    """Command of xacro: that of this environment, or the one on the PATH. Raises InputError."""
    if find_spec("xacro") is not None:
        return _MODULE
    found = shutil.which("xacro")
    if found is None:
        raise InputError(f"{path}: expected a URDF, got a xacro file, and xacro is not installed; {_HOW}")
    return (found,)


def _prefix(folder: Path, packages: Mapping[str, Path]) -> str:
    """Make an install prefix in which `packages` are found as installed ones are; empty if there are none."""
    names = folder / "share/ament_index/resource_index/packages"
    names.mkdir(parents=True)
    for name, where in packages.items():
        if not name or os.sep in name or name in (os.curdir, os.pardir, "ament_index"):
            raise InputError(f"packages: expected names of packages, got {name!r:.80}")
        (names / name).touch()
        (folder / "share" / name).symlink_to(where.resolve(), target_is_directory=True)
    return str(folder) if packages else ""
