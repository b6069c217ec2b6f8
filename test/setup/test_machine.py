"""Tests of the choice of ROS 2, Python and compiler, with simulated folders and interpreters."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import machine
import pytest
from machine import Python, RosInstall, SetupError

ROOT = Path(__file__).parents[2]
JAZZY = RosInstall("jazzy", (Path("/opt/ros/jazzy"),), (3, 12))


def make_ros(prefix: Path, python: str, *packages: str) -> Path:
    (prefix / "lib" / python / "site-packages" / "rclpy").mkdir(parents=True)
    for name in packages:
        (prefix / "share" / name).mkdir(parents=True)
    return prefix


def probe_of(**versions: tuple[int, int] | Python) -> Callable[[str], Python | None]:
    """Probe of a machine on which these commands have these versions."""
    found = {name.replace("_", "."): version for name, version in versions.items()}

    def probe(command: str) -> Python | None:
        version = found.get(command.removeprefix("/usr/bin/"))
        return version if version is None or isinstance(version, Python) else Python(f"/usr/bin/{command}", version)

    return probe


def test_no_ros_is_sourced(tmp_path: Path) -> None:
    assert machine.ros_install({}, tmp_path / ".venv") is None
    assert machine.ros_install({"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": ""}, tmp_path / ".venv") is None


def test_an_overlay_without_rclpy_is_no_install(tmp_path: Path) -> None:
    assert machine.ros_install({"AMENT_PREFIX_PATH": str(tmp_path)}, tmp_path / ".venv") is None


@pytest.mark.parametrize("python", ["python3.12", "python3.13"])
def test_a_sourced_install_is_found_below_its_overlays(tmp_path: Path, python: str) -> None:
    install = make_ros(tmp_path / "jazzy", python)
    environ = {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": f"{tmp_path}/overlay:{install}"}
    ros = machine.ros_install(environ, tmp_path / ".venv")
    assert ros == RosInstall("jazzy", (tmp_path / "overlay", install), (3, int(python[-2:])))


def test_our_own_environment_is_no_install(tmp_path: Path) -> None:
    venv = make_ros(tmp_path / ".venv", "python3.12")
    assert machine.ros_install({"AMENT_PREFIX_PATH": str(venv)}, venv) is None


def test_missing_ros_packages_are_named_as_apt_names_them(tmp_path: Path) -> None:
    prefix = make_ros(tmp_path, "python3.12", *(set(machine.ROS_PACKAGES) - {"rosidl_default_generators"}))
    ros = RosInstall("jazzy", (prefix,), (3, 12))
    with pytest.raises(SetupError, match=r"sudo apt install ros-jazzy-rosidl-default-generators$"):
        machine.require_ros_packages(ros)
    (prefix / "share" / "rosidl_default_generators").mkdir()
    machine.require_ros_packages(ros)


@pytest.mark.parametrize(
    ("pythons", "chosen"),
    [
        ({"python3": (3, 11)}, (3, 11)),
        ({"python3": (3, 12), "python3_13": (3, 13)}, (3, 12)),
        ({"python3": (3, 10), "python3_11": (3, 11), "python3_13": (3, 13)}, (3, 13)),
        ({"python3": (3, 14), "python3_12": (3, 12)}, (3, 12)),
        ({"python3": Python("/usr/bin/python3", (3, 12), ("python3-dev",)), "python3_11": (3, 11)}, (3, 11)),
    ],
)
def test_the_first_python_that_will_do(pythons: dict[str, tuple[int, int] | Python], chosen: tuple[int, int]) -> None:
    assert machine.choose_python(None, probe_of(**pythons)).version == chosen


def test_no_usable_python_is_one_line_with_the_cure() -> None:
    cure = r"found: 3\.9, 3\.14.*sudo apt install python3 python3-venv python3-dev"
    with pytest.raises(SetupError, match=cure) as error:
        machine.choose_python(None, probe_of(python3=(3, 14), python3_11=(3, 9)))
    assert "\n" not in str(error.value)


def test_an_incomplete_python_says_what_completes_it() -> None:
    lacking = Python("/usr/bin/python3", (3, 12), ("python3.12-venv", "python3.12-dev"))
    with pytest.raises(SetupError, match=r"install: sudo apt install python3\.12-venv python3\.12-dev$"):
        machine.choose_python(None, probe_of(python3=lacking))


def test_a_ros_install_gets_the_python_it_was_built_for() -> None:
    assert machine.choose_python(JAZZY, probe_of(python3=(3, 13), python3_12=(3, 12))).version == (3, 12)
    with pytest.raises(SetupError, match=r"python3\.12 of ROS 2 jazzy"):
        machine.choose_python(JAZZY, probe_of(python3=(3, 13)))


def test_a_ros_install_that_is_too_old_is_refused() -> None:
    humble = RosInstall("humble", (Path("/opt/ros/humble"),), (3, 10))
    with pytest.raises(SetupError, match=r"humble runs on Python 3\.10"):
        machine.choose_python(humble, probe_of(python3=(3, 10)))


def test_wheels_need_linux_on_x86_64() -> None:
    machine.require_wheel_platform("Linux", "x86_64")
    with pytest.raises(SetupError, match="this is Linux on aarch64; install ROS 2"):
        machine.require_wheel_platform("Linux", "aarch64")


def test_a_missing_compiler_is_one_line_with_the_cure() -> None:
    with pytest.raises(SetupError, match=r"^g\+\+ not found; install: sudo apt install g\+\+$"):
        machine.require_compiler(None, lambda _: None)
    with pytest.raises(SetupError, match=r"sudo apt install cmake$"):
        machine.require_compiler(JAZZY, lambda name: None if name == "cmake" else f"/usr/bin/{name}")
    machine.require_compiler(None, lambda name: "/usr/bin/c++" if name == "c++" else None)


def test_probing_tells_the_base_of_the_interpreter_that_runs_this() -> None:
    python = machine.probe_python(sys.executable)
    assert python is not None
    assert python.version == sys.version_info[:2]
    assert Path(python.path).resolve() == Path(sys._base_executable).resolve()  # type: ignore[attr-defined]


@pytest.mark.parametrize("script", ["#!/bin/sh\nexit 127\n", "#!/bin/sh\necho pyenv: not installed\n", "not a program"])
def test_what_is_no_interpreter_is_passed_over(tmp_path: Path, script: str) -> None:
    shim = tmp_path / "python3"
    shim.write_text(script)
    shim.chmod(shim.stat().st_mode | stat.S_IXUSR)
    assert machine.probe_python(str(shim)) is None
    assert machine.probe_python(str(tmp_path / "nothing")) is None


def test_no_python_at_all_is_one_line(tmp_path: Path) -> None:
    for tool in ("sh", "dirname"):
        os.symlink(f"/bin/{tool}", tmp_path / tool)
    script = (ROOT / "scripts" / "set_up" / "start.sh").read_text().replace("/usr/bin/python3", "python3")
    (tmp_path / "start.sh").write_text(script)
    answer = subprocess.run(["sh", tmp_path / "start.sh"], env={"PATH": str(tmp_path)}, capture_output=True, text=True)
    assert answer.returncode == 1
    assert answer.stdout == ""
    assert answer.stderr.count("\n") == 1
    assert "sudo apt install python3 python3-venv python3-dev" in answer.stderr
