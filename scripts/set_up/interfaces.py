"""Build the message packages of `interfaces/` that this machine lacks: tf2, vision, autoware, moveit, maps, and more.

The definitions have exactly the fields of the published ones, so messages and type hashes agree. A package that a
sourced ROS 2 install has is left out and never shadowed. The others go into `.venv`, once: a second run only compares.

    make interfaces
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import machine
import stages

SOURCES = stages.ROOT / "interfaces"
BUILD = stages.BUILD / "interfaces"
STAMP = stages.VENV / ".set_up" / "interfaces"

_FIELD = re.compile(r"^([a-z]\w*)/[A-Z]\w*(?:\[\])? ", re.MULTILINE)

_PACKAGE_XML = """\
<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.0.0</version>
  <description>The messages of {name} that collision_monitor reads, with the published fields.</description>
  <maintainer email="maintainers@example.com">The collision_monitor maintainers</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
{depends}
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""

_CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({name})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}
# Python needs the generators of C only: half of the time to build
list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "_cpp:")
rosidl_generate_interfaces(${{PROJECT_NAME}}
  {messages}
  DEPENDENCIES {depends})
ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""


def packages() -> list[str]:
    """Return the packages of `interfaces/`."""
    return sorted(path.name for path in SOURCES.iterdir() if (path / "msg").is_dir())


def missing(ros: machine.RosInstall | None) -> list[str]:
    """Return the packages that no sourced install has."""
    prefixes = ros.prefixes if ros else ()
    return [name for name in packages() if not any((prefix / "share" / name).is_dir() for prefix in prefixes)]


def depends(name: str) -> list[str]:
    """Return the other packages that a package's messages use."""
    texts = [path.read_text() for path in (SOURCES / name / "msg").glob("*.msg")]
    return sorted({other for text in texts for other in _FIELD.findall(text)} - {name})


def write_package(name: str, folder: Path) -> None:
    """Write an ament_cmake package with the messages."""
    shutil.copytree(SOURCES / name, folder)
    needed = depends(name)
    messages = sorted(f"msg/{path.name}" for path in (folder / "msg").glob("*.msg"))
    xml = _PACKAGE_XML.format(name=name, depends="\n".join(f"  <depend>{other}</depend>" for other in needed))
    (folder / "package.xml").write_text(xml)
    finds = "\n".join(f"find_package({other} REQUIRED)" for other in needed)
    cmake = _CMAKE.format(name=name, finds=finds, messages="\n  ".join(messages), depends=" ".join(needed))
    (folder / "CMakeLists.txt").write_text(cmake)


def inputs(ros: machine.RosInstall | None) -> str:
    """Return the digest of what is built."""
    digest = hashlib.blake2b(Path(__file__).read_bytes(), digest_size=16)
    for name in missing(ros):
        for path in sorted((SOURCES / name / "msg").glob("*.msg")):
            digest.update(f"\0{name}/{path.name}\0".encode() + path.read_bytes())
    return digest.hexdigest()


def build(names: Iterable[str], ros: machine.RosInstall | None) -> None:
    """Build and install packages. Raises SetupError."""
    machine.require_compiler(ros)
    shutil.rmtree(BUILD, ignore_errors=True)
    for name in names:
        write_package(name, BUILD / "src" / name)
    colcon = "import sys; from colcon_core.command import main; sys.exit(main())"
    command: list[str | Path] = [
        *(stages.PYTHON, "-c", colcon, "--log-base", BUILD / "log", "build", "--base-paths", BUILD / "src"),
        *("--build-base", BUILD / "build", "--install-base", stages.VENV, "--merge-install", "--parallel-workers", "2"),
        *("--event-handlers", "console_cohesion-", "console_package_list-"),
        *("--cmake-args", *([] if ros else ["-G", "Ninja"]), "-DBUILD_TESTING=OFF", "-DCMAKE_BUILD_TYPE=Release"),
        *(f"-DPython3_EXECUTABLE={stages.PYTHON}", f"-DPYTHON_EXECUTABLE={stages.PYTHON}", "-Wno-deprecated"),
    ]
    answer = subprocess.run(command, cwd=stages.ROOT, env=stages.environment_variables(ros), stdin=subprocess.DEVNULL)
    if answer.returncode:
        raise machine.SetupError(f"interfaces: colcon ended with {answer.returncode} (logs: {BUILD / 'log'})")


def main() -> int:
    """Build what is missing and not built yet; return the exit code."""
    ros = machine.ros_install(os.environ, stages.VENV)
    names, digest = missing(ros), inputs(ros)
    if STAMP.exists() and STAMP.read_text() == digest:
        return 0
    print(f"Building {', '.join(names)} (once, about a minute)", flush=True)
    try:
        build(names, ros)
    except machine.SetupError as error:
        print(f"set-up: {error}", file=sys.stderr)
        return 1
    STAMP.parent.mkdir(exist_ok=True)
    STAMP.write_text(digest)
    return 0


if __name__ == "__main__":
    sys.exit(main())
