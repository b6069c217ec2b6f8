"""Properties of this machine: ROS 2 install, usable Python, compiler. These functions only decide, without changes."""

from __future__ import annotations

import json
import platform
import shutil
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

OLDEST = (3, 11)
NEWEST_WHEELS = (3, 13)
"""Newest CPython with ROS 2 wheels, which exist for 3.11 to 3.13; a ROS 2 install brings its own Python."""

ROS_PACKAGES = (
    "ament_cmake",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "rclpy",
    "rosidl_default_generators",
    "std_msgs",
    "visualization_msgs",
)


class SetupError(Exception):
    """This machine lacks something; the text is one line with the remedy."""


@dataclass(frozen=True)
class RosInstall:
    """A sourced ROS 2 install: its name, its prefixes (overlays first) and the Python that it was built for."""

    distro: str
    prefixes: tuple[Path, ...]
    python: tuple[int, int]


@dataclass(frozen=True)
class Python:
    """An interpreter that can create an environment."""

    path: str
    version: tuple[int, int]
    missing: tuple[str, ...] = ()
    """Missing Debian packages, such as `python3-venv`."""


def ros_install(environ: Mapping[str, str], venv: Path) -> RosInstall | None:
    """Return the sourced ROS 2 install, or None if the wheels are needed.

    The prefix `venv` is ignored, because our own environment is not a ROS install.
    """
    prefixes = tuple(
        Path(prefix) for prefix in environ.get("AMENT_PREFIX_PATH", "").split(":") if prefix and Path(prefix) != venv
    )
    for prefix in prefixes:
        for folder in ("lib", "local/lib"):
            for package in sorted((prefix / folder).glob("python3.*/*-packages/rclpy")):
                version = (3, int(package.parts[-3].removeprefix("python3.")))
                return RosInstall(environ.get("ROS_DISTRO") or prefix.name, prefixes, version)
    return None


def require_ros_packages(ros: RosInstall) -> None:
    """Raise SetupError if the install lacks packages that generate our messages."""
    missing = [name for name in ROS_PACKAGES if not any((prefix / "share" / name).is_dir() for prefix in ros.prefixes)]
    if missing:
        packages = " ".join(f"ros-{ros.distro}-{name.replace('_', '-')}" for name in missing)
        raise SetupError(f"ROS 2 {ros.distro} is sourced but lacks packages; install them: sudo apt install {packages}")


def require_wheel_platform(system: str = platform.system(), machine: str = platform.machine()) -> None:
    """Raise SetupError on a platform without ROS 2 wheels."""
    if (system, machine) != ("Linux", "x86_64"):
        raise SetupError(
            f"the ROS 2 wheels exist for Linux on x86-64, this is {system} on {machine}; "
            "install ROS 2 Jazzy, source its setup.bash and run this again"
        )


def require_compiler(ros: RosInstall | None, which: Callable[[str], str | None] = shutil.which) -> None:
    """Raise SetupError without a C++ compiler or, with a ROS install, without CMake and make (wheels bring them)."""
    missing = [] if which("g++") or which("c++") or which("clang++") else ["g++"]
    if ros and not which("cmake"):
        missing.append("cmake")
    if ros and not which("make"):
        missing.append("make")
    if missing:
        raise SetupError(f"{' and '.join(missing)} not found; install: sudo apt install {' '.join(missing)}")


_PROBE = """
import importlib.util, json, os, sys, sysconfig
print(json.dumps({
    "path": getattr(sys, "_base_executable", sys.executable),
    "version": sys.version_info[:2],
    "cpython": sys.implementation.name == "cpython",
    "venv": all(importlib.util.find_spec(name) for name in ("venv", "ensurepip")),
    "headers": os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")),
}))
"""


def probe_python(command: str) -> Python | None:
    """Run an interpreter and return its properties; None if it does not run. A virtual environment gives its base."""
    try:
        answer = subprocess.run([command, "-I", "-S", "-c", _PROBE], capture_output=True, text=True, timeout=30)
        facts = json.loads(answer.stdout)
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return None
    if not facts["cpython"]:
        return None
    name = f"python3.{facts['version'][1]}" if facts["path"].startswith("/usr/bin/") else "python3"
    missing = ([] if facts["venv"] else [f"{name}-venv"]) + ([] if facts["headers"] else [f"{name}-dev"])
    return Python(facts["path"], (facts["version"][0], facts["version"][1]), tuple(missing))


def choose_python(ros: RosInstall | None, probe: Callable[[str], Python | None] = probe_python) -> Python:
    """Return the interpreter for the environment: python3 if suitable, else the newest suitable one.

    With a ROS 2 install, only the Python that it was built for is suitable. Raises SetupError.
    """
    if ros:
        wanted = f"python{ros.python[0]}.{ros.python[1]}"
        if ros.python < OLDEST:
            raise SetupError(
                f"ROS 2 {ros.distro} runs on Python {ros.python[0]}.{ros.python[1]}, collision_monitor needs 3.11 or "
                "newer; source ROS 2 Jazzy or newer, or run this in a shell without ROS to use the wheels"
            )
        commands = [f"/usr/bin/{wanted}", wanted, "python3"]
        oldest = newest = ros.python
    else:
        wanted = "python3"
        commands = ["python3", "/usr/bin/python3", "python3.13", "python3.12", "python3.11"]
        oldest, newest = OLDEST, NEWEST_WHEELS
    found = [python for command in commands if (python := probe(command))]
    in_range = [python for python in found if oldest <= python.version <= newest]
    for python in in_range:
        if not python.missing:
            return python
    if in_range:
        raise SetupError(f"{in_range[0].path} is incomplete; install: sudo apt install {' '.join(in_range[0].missing)}")
    versions = f"{wanted} of ROS 2 {ros.distro}" if ros else "Python 3.11, 3.12 or 3.13"
    seen = ", ".join(f"{version[0]}.{version[1]}" for version in sorted({python.version for python in found})) or "none"
    packages = f"{wanted} {wanted}-venv {wanted}-dev"
    raise SetupError(f"no {versions} found (found: {seen}); install: sudo apt install {packages}")
