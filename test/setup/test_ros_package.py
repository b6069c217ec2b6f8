"""Tests of a colcon build as in a user's workspace, with the executables where `ros2 run` looks for them."""

from __future__ import annotations

import ast
import os
import re
import shlex
import signal
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import machine
import pytest
import stages

from collision_monitor._version import VERSION

ROOT = Path(__file__).parents[2]
EXECUTABLES = {"monitor", "guard", "gate", "world", "replay", "collision-monitor"}
COLCON = "import sys; from colcon_core.command import main; sys.exit(main())"

PREFIXES = ":".join(filter(None, (sys.prefix, os.environ.get("AMENT_PREFIX_PATH"))))
"""Prefixes of our messages, and of ROS 2 itself if an install is sourced."""


@pytest.fixture(scope="module")
def install(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package, built and installed into a separate workspace. Its messages come from the environment."""
    workspace = tmp_path_factory.mktemp("workspace")
    folders = ("--build-base", workspace / "build", "--install-base", workspace / "install")
    command = [sys.executable, "-c", COLCON, "--log-base", workspace / "log", "build", "--base-paths", ROOT, *folders]
    environment = os.environ | {"COLCON_HOME": str(workspace / "home"), "AMENT_PREFIX_PATH": PREFIXES}
    selected = [*command, "--packages-select", "collision_monitor"]
    answer = subprocess.run(selected, env=environment, cwd=workspace, capture_output=True, text=True, timeout=120)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    return workspace / "install"


def sourced(install: Path, *command: str | Path) -> list[str]:
    """The command in a shell that has sourced the workspace, like a ROS user's shell."""
    # colcon's scripts do not quote the path of the interpreter, so it must not contain a space
    interpreter = f"COLCON_PYTHON_EXECUTABLE={shlex.quote(os.path.realpath(sys.executable))}"
    source = f"{interpreter} source {shlex.quote(str(install))}/setup.bash"
    return ["bash", "-c", f"{source} && exec {shlex.join(map(str, command))}"]


def run(install: Path, *command: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(sourced(install, *command), cwd=install, capture_output=True, text=True, timeout=60)


def executable(install: Path, name: str) -> Path:
    return install / "collision_monitor" / "lib" / "collision_monitor" / name


def test_the_package_is_in_the_ament_index(install: Path) -> None:
    code = (
        "from ament_index_python.packages import get_package_prefix, get_package_share_directory as share\n"
        "print(get_package_prefix('collision_monitor'), share('collision_monitor'), sep='\\n')"
    )
    answer = run(install, sys.executable, "-c", code)
    assert answer.returncode == 0, answer.stderr
    prefix, share = map(Path, answer.stdout.splitlines())
    assert prefix == install / "collision_monitor"
    installed = {str(path.relative_to(share)) for folder in ("config", "launch") for path in (share / folder).iterdir()}
    assert {
        "config/monitor.yaml",
        "launch/monitor.launch.py",
        "launch/demo.launch.py",
        "launch/gate.launch.py",
    } <= installed
    assert (share / "package.xml").is_file()


def test_ros2_run_finds_every_executable(install: Path) -> None:
    folder = install / "collision_monitor" / "lib" / "collision_monitor"
    assert {path.name for path in folder.iterdir() if os.access(path, os.X_OK)} == EXECUTABLES


def test_the_set_up_installs_what_colcon_does(install: Path) -> None:
    """Without colcon, `make setup` links the same files into the environment."""
    built = install / "collision_monitor"
    share = built / "share" / "collision_monitor"
    by_colcon = [
        built / "share" / "ament_index" / "resource_index" / "packages" / "collision_monitor",
        *(share / "package.xml", *(share / "config").iterdir(), *(share / "launch").iterdir()),
        *(built / "lib" / "collision_monitor").iterdir(),
    ]
    linked = {place.relative_to(stages.VENV) for place in stages.ros_files()}
    assert {path.relative_to(built) for path in by_colcon} == linked


def ros2_finds(kind: str) -> dict[str, Path]:
    """Files of the package in this environment, found by the rules of `ros2 run` and `ros2 launch`, by their names.

    Those of ros2pkg.api.get_executable_paths and ros2launch.api.get_share_file_path_from_package. The commands
    themselves are no wheels.
    """
    code = (
        "import os\n"
        "from ament_index_python.packages import get_package_prefix, get_package_share_directory\n"
        "prefix = get_package_prefix('collision_monitor')\n"
        "folders = {'run': os.path.join(prefix, 'lib', 'collision_monitor'),\n"
        "           'launch': get_package_share_directory('collision_monitor')}\n"
        f"for folder, _, files in os.walk(folders['{kind}']):\n"
        "    for path in (os.path.join(folder, name) for name in files):\n"
        f"        if os.access(path, os.X_OK if '{kind}' == 'run' else os.R_OK):\n"
        "            print(path)\n"
    )
    command = f"source {shlex.quote(str(stages.VENV))}/local_setup.bash && exec {shlex.quote(sys.executable)} -c"
    answer = subprocess.run(
        ["bash", "-c", f"{command} {shlex.quote(code)}"], cwd="/", env=plain_shell(), capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr
    return {path.name: path for path in map(Path, answer.stdout.splitlines())}


def plain_shell() -> dict[str, str]:
    """The variables of a shell in which nothing but a ROS 2 install, if there is one, is exported or sourced."""
    if machine.ros_install(os.environ, stages.VENV):
        return dict(os.environ)
    ours = ("AMENT_", "COLCON_", "CMAKE_", "PYTHON", "LD_LIBRARY", "_ROS_WHEELS", "VIRTUAL_ENV")
    return {key: value for key, value in os.environ.items() if not key.startswith(ours)}


def test_after_the_set_up_ros2_finds_executables_launch_files_and_parameters_without_colcon() -> None:
    run, launch = ros2_finds("run"), ros2_finds("launch")
    assert run.keys() == EXECUTABLES
    assert {"monitor.launch.py", "demo.launch.py", "monitor.yaml", "package.xml"} <= launch.keys()
    for path in (*run.values(), *launch.values()):
        assert path.is_relative_to(stages.VENV), "not what another workspace installed"
    assert launch["monitor.yaml"].read_bytes() == (ROOT / "config" / "monitor.yaml").read_bytes()


@pytest.mark.parametrize("name", ["monitor", "world"])
def test_after_the_set_up_ros2_run_starts_a_node(ros_domain_id: int, name: str) -> None:
    path = ros2_finds("run")[name]
    environment = plain_shell()  # `ros2 run` adds nothing to it
    with subprocess.Popen(
        [path, "--ros-args", "-r", f"__node:=started_{name}"],
        env=environment, cwd="/", stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    ) as process:  # fmt: skip
        assert process.stdout
        first = process.stdout.readline()
        process.send_signal(signal.SIGINT)
        rest = process.stdout.read()
        assert process.wait(30) == 0, first + rest
    assert "Traceback" not in first + rest
    assert f"[started_{name}]" in first


def test_after_the_set_up_ros2_run_replays_help() -> None:
    answer = subprocess.run(
        [ros2_finds("run")["replay"], "--help"], env=plain_shell(), cwd="/", capture_output=True, text=True, timeout=60
    )
    assert answer.stdout.startswith("usage: collision-monitor replay"), answer.stderr


def test_the_installed_copy_runs_not_the_source(install: Path) -> None:
    code = "import collision_monitor; print(list(collision_monitor.__path__))"
    answer = run(install, sys.executable, "-P", "-c", code)
    assert str(install) in answer.stdout, answer.stderr


def test_the_command_line_runs_from_the_workspace(install: Path) -> None:
    assert run(install, executable(install, "collision-monitor"), "--version").stdout.endswith(f"{VERSION}\n")
    answer = run(install, executable(install, "replay"), "--help")
    assert answer.stdout.startswith("usage: collision-monitor replay"), answer.stderr


@pytest.mark.parametrize("name", ["monitor", "world"])
def test_a_node_starts_and_ends_cleanly_when_interrupted(install: Path, ros_domain_id: int, name: str) -> None:
    # The executable is from the workspace; the modules are from the source, because their kernels are already compiled.
    command = sourced(install, "env", f"PYTHONPATH={ROOT}", executable(install, name))
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout
        first = process.stdout.readline()  # the node reports that it runs
        process.send_signal(signal.SIGINT)
        rest = process.stdout.read()
        assert process.wait(30) == 0, first + rest
    assert "Traceback" not in first + rest
    assert "[INFO]" in first


def test_versions_agree() -> None:
    for package in (ROOT / "package.xml", ROOT / "collision_monitor_msgs" / "package.xml"):
        assert ET.parse(package).findtext("version") == VERSION
    newest = re.search(r"^(\d+\.\d+\.\d+) ", (ROOT / "CHANGELOG.rst").read_text(), re.MULTILINE)
    assert newest is not None
    assert newest[1] == VERSION


def test_every_message_is_built() -> None:
    folder = ROOT / "collision_monitor_msgs"
    listed = set(re.findall(r"(?:msg|srv)/\w+\.(?:msg|srv)", (folder / "CMakeLists.txt").read_text()))
    assert listed == {f"{path.parent.name}/{path.name}" for kind in ("msg", "srv") for path in folder.glob(f"{kind}/*")}


def test_what_is_imported_is_declared() -> None:
    """Each top-level import of the package is the standard library, a ROS package of package.xml or a requirement."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    modules = {"python-fcl": "fcl", "PyYAML": "yaml"}
    extras = project["optional-dependencies"]
    requirements = project["dependencies"] + extras["ray"] + extras["view"]
    names = {re.split(r"[<>=\[; ]", requirement)[0] for requirement in requirements}
    declared = {modules.get(name, name.replace("-", "_")) for name in names}
    declared |= {element.text for element in ET.parse(ROOT / "package.xml").iter("depend") if element.text}
    # only pytest imports its plugin; bondpy is used where nav2 has installed it, pandas where a user has
    declared |= {"pytest", "bondpy", "pandas", "mpl_toolkits"}  # the last is a part of matplotlib
    used = set()
    for path in (ROOT / "collision_monitor").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                used |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                used.add(node.module.partition(".")[0])
    assert used - set(sys.stdlib_module_names) - declared - {"collision_monitor"} == set()
