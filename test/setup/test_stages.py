"""Tests of the selection of stages after fresh, finished, interrupted, changed, damaged and moved set-ups."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import threading
import time
from pathlib import Path

import machine
import pytest
import schedule
import stages

ROOT = Path(__file__).parents[2]
SPEC = importlib.util.spec_from_file_location("set_up", ROOT / "scripts" / "set_up" / "__main__.py")
assert SPEC
assert SPEC.loader
set_up = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(set_up)

NAMES = [stage.name for stage in stages.STAGES]
ROS = machine.ros_install(os.environ, stages.VENV)


@pytest.fixture
def stamps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stamps of a finished set-up of this environment, for the test to modify."""
    monkeypatch.setattr(set_up, "STAMPS", tmp_path)
    for stage in stages.STAGES:
        (tmp_path / stage.name).write_text(stage.inputs(ROS))
    return tmp_path


def pending() -> list[str]:
    return [stage.name for stage in set_up.stages_to_run(ROS)[0]]


def python_in_front_of_which(tmp_path: Path, module: str) -> Path:
    """This environment's Python, in which the import of that module fails like that of a damaged one."""
    broken = tmp_path / "broken" / module
    broken.mkdir(parents=True)
    (broken / "__init__.py").write_text("raise ImportError('file too short')\n")
    python = tmp_path / "broken" / "python"
    python.write_text(f'#!/bin/sh\nPYTHONPATH="{broken.parent}:$PYTHONPATH" exec "{stages.PYTHON}" "$@"\n')
    python.chmod(0o755)
    return python


def test_nothing_runs_again_when_all_is_well(stamps: Path) -> None:
    assert pending() == []


def test_everything_runs_at_first(stamps: Path) -> None:
    for stamp in stamps.iterdir():
        stamp.unlink()
    assert pending() == NAMES


@pytest.mark.parametrize("name", ["environment", "packages"])
def test_an_interrupted_installation_starts_anew(stamps: Path, name: str) -> None:
    (stamps / name).unlink()
    assert pending() == NAMES


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("environment", "packages")])
def test_an_interrupted_later_stage_runs_alone(stamps: Path, name: str) -> None:
    (stamps / name).unlink()
    assert pending() == [name]


@pytest.mark.parametrize("name", [name for name in NAMES if name != "environment"])
def test_changed_inputs_run_their_stage_alone(stamps: Path, name: str) -> None:
    (stamps / name).write_text("the digest of something else")
    assert pending() == [name]


def test_a_moved_clone_starts_anew(stamps: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "VENV", stamps / "elsewhere" / ".venv")
    assert pending() == NAMES


def test_another_ros_starts_anew(stamps: Path) -> None:
    other = machine.RosInstall("rolling", (Path("/opt/ros/rolling"),), (3, 12))
    assert [stage.name for stage in set_up.stages_to_run(other)[0]] == NAMES


def test_an_environment_whose_python_is_gone_starts_anew(stamps: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "PYTHON", stamps / "no" / "python")
    assert pending() == NAMES


@pytest.mark.parametrize("module", ["rclpy", "numpy", "llvmlite"])
def test_damaged_packages_start_anew(
    stamps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str
) -> None:
    monkeypatch.setattr(stages, "PYTHON", python_in_front_of_which(tmp_path, module))
    assert pending() == NAMES


def test_damaged_messages_are_built_again(stamps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "PYTHON", python_in_front_of_which(tmp_path, stages.MESSAGES))
    assert pending() == ["messages"]


def test_a_package_of_another_clone_is_installed_again(
    stamps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "broken" / "collision_monitor"
    python = python_in_front_of_which(tmp_path, "collision_monitor")
    (other / "__init__.py").write_text("")
    monkeypatch.setattr(stages, "PYTHON", python)
    assert pending() == ["package"]


@pytest.fixture
def links(stamps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The package's files for ROS 2, linked into an environment whose other parts are those of this one."""
    environment = tmp_path / "another"  # the stamps are beside it
    environment.mkdir()
    (environment / "bin").symlink_to(stages.VENV / "bin")
    monkeypatch.setattr(stages, "VENV", environment)
    (stamps / "environment").write_text(stages._environment_inputs(ROS))
    (stamps / "package").write_text(stages._package_inputs(ROS))
    stages._link_ros_files()
    return environment


def test_a_missing_file_for_ros_installs_the_package_again(links: Path) -> None:
    (links / "lib" / "collision_monitor" / "monitor").unlink()
    assert pending() == ["package"]
    stages._link_ros_files()
    assert pending() == []


def test_each_missing_or_foreign_file_for_ros_is_noticed(links: Path) -> None:
    places = {str(place.relative_to(links)) for place in stages.ros_files()}
    assert {
        "share/ament_index/resource_index/packages/collision_monitor",
        "share/collision_monitor/package.xml",
        "share/collision_monitor/launch/monitor.launch.py",
        "lib/collision_monitor/monitor",
    } <= places
    for gone in sorted(places):
        assert stages.missing_ros_file() is None
        (links / gone).unlink()
        assert stages.missing_ros_file() == links / gone
        (links / gone).write_text("of another package")
        assert stages.missing_ros_file() == links / gone
        stages._link_ros_files()


def test_files_for_ros_that_are_no_more_are_removed(links: Path) -> None:
    for folder in ("share/collision_monitor/launch", "lib/collision_monitor"):
        (links / folder / "old").symlink_to(ROOT / "no_more")
    stages._link_ros_files()
    found = {path for folder in ("share", "lib") for path in (links / folder).rglob("*") if not path.is_dir()}
    assert found == set(stages.ros_files())


def test_a_new_launch_file_is_linked(links: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = tmp_path / "root"
    for source in stages.ros_files().values():
        if source.is_relative_to(ROOT) and not source.is_relative_to(ROOT / ".venv"):
            (root / source.relative_to(ROOT)).parent.mkdir(parents=True, exist_ok=True)
            (root / source.relative_to(ROOT)).write_text("")
    for name in ("pyproject.toml", "setup.py", "setup.cfg"):
        (root / name).write_text("")
    monkeypatch.setattr(stages, "ROOT", root)
    before = stages._package_inputs(ROS)
    (root / "launch" / "new.launch.py").write_text("")
    assert stages._package_inputs(ROS) != before


def test_exported_variables_of_other_pythons_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    strays = ("PYTHONHOME", "VIRTUAL_ENV", "PIP_USER", "PIP_TARGET", "COLCON_DEFAULTS_FILE")
    for name in strays:
        monkeypatch.setenv(name, "/somewhere/else")
    monkeypatch.setenv("PYTHONPATH", "/somewhere/else")
    assert not set(strays) & set(stages.environment_variables(None))
    assert "PYTHONPATH" not in stages.environment_variables(None)
    install = machine.RosInstall("jazzy", (Path("/opt/ros/jazzy"),), (3, 12))
    assert stages.environment_variables(install)["PYTHONPATH"] == "/somewhere/else"
    assert stages.environment_variables(install)["AMENT_PREFIX_PATH"] == f"{stages.VENV}:/opt/ros/jazzy"


def test_kernels_are_compiled_again_when_a_module_changes_that_they_import() -> None:
    names = {str(path.relative_to(ROOT / "collision_monitor")) for path in stages.compiled_sources()}
    kernels = {"broad_phase/dense_grid.py", "monitor/event_list.py", "detection/kernels.py", "_jit/__init__.py"}
    below = {"warm_up.py", "tolerances.py", "records.py", "geometry/polygons.py", "settings/setting.py"}
    assert kernels | below <= names
    assert not [name for name in names if name.startswith(("cli/", "ros/", "report/", "session/"))]


def test_compiled_kernels_stay_for_a_month(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "VENV", tmp_path)
    cache = tmp_path / "var" / "cache" / "collision_monitor"
    for days in range(40):
        (cache / str(days) / "prediction").mkdir(parents=True)
        os.utime(cache / str(days), (time.time() - 86400 * (days + 0.5),) * 2)
    stages.remove_old_kernels()
    assert sorted(int(each.name) for each in cache.iterdir()) == list(range(30))


def test_a_second_run_only_checks() -> None:
    subprocess.run(["make", "-s", "setup"], cwd=ROOT, capture_output=True, timeout=600, check=True)
    answer = subprocess.run(["make", "-s", "setup"], cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert (answer.returncode, answer.stdout, answer.stderr) == (0, "", "")


def test_a_demo_waits_only_for_what_it_shows(stamps: Path) -> None:
    for name in ("options", "functions", "tools"):
        (stamps / name).unlink()
    assert set_up.stages_to_run(ROS, for_demo=True)[0] == []
    assert pending() == ["options", "functions", "tools"]
    assert [stage.name for stage in set_up._rest()] == ["options", "functions"]


ABSENT = """
import os, sys, sysconfig

class Absent:
    @staticmethod
    def find_spec(name, path=None, target=None):
        top = name.partition(".")[0]
        site = sysconfig.get_path("purelib")
        if top not in {allowed} and any(os.path.exists(os.path.join(site, top + end)) for end in ("", ".py")):
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent)
from collision_monitor import warm_up
warm_up.PARTS["monitor"]()
"""


def test_the_compilation_needs_nothing_that_is_installed_beside_it() -> None:
    """It runs while pip installs the other packages."""
    program = ABSENT.format(allowed={"yaml", "_yaml", *stages.COMPILER})
    answer = subprocess.run([stages.PYTHON, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert answer.returncode == 0, answer.stderr


def stage(name: str, *after: str) -> stages.Stage:
    return stages.Stage(name, "", lambda _: "", lambda _, __: None, after)


CHAIN = [stage("a"), stage("b", "a"), stage("c", "a"), stage("d", "a", "b")]


def test_stages_run_side_by_side_and_none_before_those_it_needs() -> None:
    began: list[str] = []
    together = threading.Barrier(2)  # b and c wait for each other, so they must run at the same time

    def work(each: stages.Stage) -> None:
        began.append(each.name)
        if each.name in "bc":
            together.wait(timeout=10)

    schedule.run(CHAIN, work)
    assert began[0] == "a"
    assert began[3] == "d"
    assert sorted(began) == list("abcd")


def test_a_stage_waits_only_for_those_that_run_again() -> None:
    began: list[str] = []
    schedule.run(CHAIN[3:], lambda each: began.append(each.name))
    assert began == ["d"]


def test_no_stage_begins_after_a_failure() -> None:
    began: list[str] = []

    def work(each: stages.Stage) -> None:
        began.append(each.name)
        if each.name == "a":
            raise OSError("no space")

    with pytest.raises(schedule.StageError, match="a: no space"):
        schedule.run(CHAIN, work)
    assert began == ["a"]


def test_stages_need_only_earlier_ones() -> None:
    known: set[str] = set()
    for each in stages.STAGES:
        assert set(each.after) <= known
        known.add(each.name)
