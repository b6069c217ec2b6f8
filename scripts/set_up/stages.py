"""Stages of the set-up, in order, with their inputs and their work, and a check of the installed result."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import time
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, Any

import machine

ROOT = Path(__file__).resolve().parents[2]
VENV = ROOT / ".venv"
BUILD = ROOT / "build"
PYTHON = VENV / "bin" / "python"
PACKAGE = "collision_monitor"
MESSAGES = "collision_monitor_msgs"

_IMPORT = re.compile(rf"^\s*from ({PACKAGE}[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


@dataclass(frozen=True)
class Stage:
    """One stage: its name, the text shown while it runs, the digest of its inputs, and its work.

    after: the stages that have to be done before, all of them. for_demo: the demo needs it.
    """

    name: str
    text: str
    inputs: Callable[[machine.RosInstall | None], str]
    run: Callable[[machine.RosInstall | None, IO[str]], None]
    after: tuple[str, ...] = ()
    for_demo: bool = True


def _digest(*parts: str, files: Iterable[Path] = ()) -> str:
    digest = hashlib.blake2b("\0".join(parts).encode(), digest_size=16)
    for path in files:
        digest.update(f"\0{path.relative_to(ROOT)}\0".encode() + path.read_bytes())
    return digest.hexdigest()


def environment_variables(ros: machine.RosInstall | None) -> dict[str, str]:
    """Variables for every command, without the caller's settings for other Pythons or other workspaces."""
    strays = ("PYTHONHOME", "VIRTUAL_ENV", "_ROS_WHEELS_BOOTSTRAP_COMPLETE", "PIP_USER", "PIP_TARGET", "PIP_PREFIX")
    env = {key: value for key, value in os.environ.items() if key not in strays and not key.startswith("COLCON_")}
    prefixes = [str(VENV)]
    libraries = [str(VENV / "lib"), *filter(None, env.get("LD_LIBRARY_PATH", "").split(":"))]
    if ros:
        prefixes += [str(prefix) for prefix in ros.prefixes]
    else:
        env.pop("PYTHONPATH", None)
    return env | {
        "PATH": f"{VENV / 'bin'}:{env.get('PATH', os.defpath)}",
        "AMENT_PREFIX_PATH": ":".join(prefixes),
        "CMAKE_PREFIX_PATH": ":".join(prefixes),
        "LD_LIBRARY_PATH": ":".join(libraries),
        "COLCON_HOME": str(BUILD / "colcon_home"),  # not the user's defaults
        "COLCON_LOG_LEVEL": "30",
    }


def _call(log: IO[str], ros: machine.RosInstall | None, *command: str | Path) -> None:
    log.write(f"$ {' '.join(map(str, command))}\n")
    log.flush()
    env = environment_variables(ros)
    subprocess.run(command, cwd=ROOT, env=env, stdin=subprocess.DEVNULL, stdout=log, stderr=log, check=True)


# environment ---------------------------------------------------------------------------------------------------------


def _environment_inputs(ros: machine.RosInstall | None) -> str:
    # Scripts in an environment contain its path, so a clone that was moved needs a new one.
    return _digest(str(VENV), *(map(str, (*ros.prefixes, ros.python)) if ros else ("wheels",)))


def _make_environment(ros: machine.RosInstall | None, log: IO[str]) -> None:
    python = machine.choose_python(ros)
    shutil.rmtree(VENV, ignore_errors=True)
    _call(log, ros, python.path, "-m", "venv", *(["--system-site-packages"] if ros else []), VENV)


# packages ------------------------------------------------------------------------------------------------------------


def _project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())


def compiler() -> list[str]:
    """What compiles the kernels and runs them. They are compiled while the other packages are installed."""
    wanted: list[str] = _project()["project"]["dependencies"]
    return [each for each in wanted if re.split(r"[<>=]", each)[0] in COMPILER]


def requirements(ros: machine.RosInstall | None) -> list[str]:
    """What the program and its set-up need: the project's own requirements, and ROS 2 unless an install is sourced."""
    project = _project()
    wanted: list[str] = list(project["build-system"]["requires"])
    wanted += project["project"]["dependencies"] + project["project"]["optional-dependencies"]["messages"]
    return wanted + ([] if ros else ros_wheels())


def tools() -> list[str]:
    """What only the tests, the lint and some options need: 40 % of all downloads."""
    groups: dict[str, list[str]] = _project()["project"]["optional-dependencies"]
    return [name for group, names in groups.items() if group != "messages" for name in names]


def ros_wheels() -> list[str]:
    """ROS 2 itself as wheels, for use without a sourced install."""
    lines = Path(__file__).with_name("ros_wheels.txt").read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


COMPILER = ("numpy", "numba", "llvmlite", "scipy", "PyYAML")
"""All that the compilation of the kernels imports."""


def _compiler_inputs(ros: machine.RosInstall | None) -> str:
    return _digest(*compiler())


def _install_compiler(ros: machine.RosInstall | None, log: IO[str]) -> None:
    _install(ros, log, compiler())


def _packages_inputs(ros: machine.RosInstall | None) -> str:
    return _digest(*requirements(ros))


def _install_packages(ros: machine.RosInstall | None, log: IO[str]) -> None:
    _install(ros, log, requirements(ros))
    if not ros:
        correct_exported_paths(log)


def _tools_inputs(ros: machine.RosInstall | None) -> str:
    return _digest(*tools())


def _install_tools(ros: machine.RosInstall | None, log: IO[str]) -> None:
    _install(ros, log, tools())


def _install(ros: machine.RosInstall | None, log: IO[str], wanted: list[str]) -> None:
    # --no-compile: half of the modules are never imported, and the others are compiled at their import
    pip = (PYTHON, "-m", "pip", "install", "--no-user", "--no-compile", "--disable-pip-version-check")
    _call(log, ros, *pip, *wanted)


def correct_exported_paths(log: IO[str]) -> None:
    """Let CMake find Python: files exported by the wheels contain the paths of the machine that built them."""
    command = "import sysconfig as s; print(s.get_path('include'), s.get_path('purelib'), sep='\\n')"
    answer = subprocess.run([PYTHON, "-I", "-c", command], capture_output=True, text=True, check=True)
    include, packages = answer.stdout.splitlines()
    for path in sorted((VENV / "share").rglob("*.cmake")):
        before = path.read_text(encoding="utf-8", errors="surrogateescape")
        after = re.sub(r"/opt/python/[^/;\"]+/include/python3\.\d+", lambda _: include, before)
        after = re.sub(r"/opt/python/[^/;\"]+/lib/python3\.\d+/site-packages", lambda _: packages, after)
        if after != before:
            path.write_text(after, encoding="utf-8", errors="surrogateescape")
            log.write(f"corrected {path.relative_to(VENV)}\n")


# messages ------------------------------------------------------------------------------------------------------------


def _messages_inputs(ros: machine.RosInstall | None) -> str:
    sources = ROOT / MESSAGES
    messages = sorted([*(sources / "msg").glob("*.msg"), *(sources / "srv").glob("*.srv")])
    generators = [] if ros else ros_wheels()
    return _digest(*generators, files=[sources / "CMakeLists.txt", sources / "package.xml", *messages])


def _build_messages(ros: machine.RosInstall | None, log: IO[str]) -> None:
    machine.require_compiler(ros)
    build = BUILD / "messages"
    shutil.rmtree(build, ignore_errors=True)
    for pattern in ("lib/python3*/site-packages/{}*", "lib/lib{}*", "include/{}", "share/{}"):
        for old in VENV.glob(pattern.format(MESSAGES)):
            shutil.rmtree(old) if old.is_dir() else old.unlink()
    colcon = "import sys; from colcon_core.command import main; sys.exit(main())"
    _call(
        log, ros,
        PYTHON, "-c", colcon, "--log-base", build / "log",
        "build", "--base-paths", MESSAGES, "--build-base", build, "--install-base", VENV, "--merge-install",
        "--event-handlers", "console_direct+",
        "--cmake-args", *([] if ros else ["-G", "Ninja", "-DPYTHON_ONLY=ON"]), "-DBUILD_TESTING=OFF",
        "-DCMAKE_BUILD_TYPE=Release", f"-DPython3_EXECUTABLE={PYTHON}", f"-DPYTHON_EXECUTABLE={PYTHON}",
        "-Wno-deprecated",
    )  # fmt: skip


# package -------------------------------------------------------------------------------------------------------------


EXECUTABLES = ("monitor", "guard", "gate", "world", "replay", "collision-monitor")


def ros_files() -> dict[Path, Path]:
    """Files by which `ros2 run`, `ros2 launch` and ament_index find the package: each place, and what it links to.

    The places and the files are those of a colcon build. pip installs none of them for an editable package.
    """
    share = VENV / "share"
    data = [ROOT / "package.xml", *sorted(ROOT.glob("config/*.*")), *sorted(ROOT.glob("launch/*.py"))]
    return {
        share / "ament_index" / "resource_index" / "packages" / PACKAGE: ROOT / "resource" / PACKAGE,
        **{share / PACKAGE / path.relative_to(ROOT): path for path in data},
        **{VENV / "lib" / PACKAGE / name: VENV / "bin" / name for name in EXECUTABLES},
    }


def _link_ros_files() -> None:
    """Make the links of `ros_files` anew, in real folders: `ros2 launch` does not look into linked ones."""
    for folder in ("share", "lib"):
        shutil.rmtree(VENV / folder / PACKAGE, ignore_errors=True)
    for place, source in ros_files().items():
        place.parent.mkdir(parents=True, exist_ok=True)
        place.unlink(missing_ok=True)
        place.symlink_to(source)


def missing_ros_file() -> Path | None:
    """Return the first place of `ros_files` without its file; None if all are there."""
    for place, source in ros_files().items():
        wanted = os.X_OK if source.parent == VENV / "bin" else os.R_OK
        if not os.access(place, wanted) or place.resolve() != source.resolve():
            return place
    return None


def _package_inputs(ros: machine.RosInstall | None) -> str:
    names = (str(path) for path in ros_files().values())
    return _digest(*names, files=[ROOT / "pyproject.toml", ROOT / "setup.py", ROOT / "setup.cfg"])


def _install_package(ros: machine.RosInstall | None, log: IO[str]) -> None:
    pip = (PYTHON, "-m", "pip", "install", "--no-user", "--disable-pip-version-check")
    # compat: a plain path instead of an import hook, because type checkers and editors understand it too.
    settings = ("--config-settings", "editable_mode=compat")
    _call(log, ros, *pip, "--no-deps", "--no-build-isolation", *settings, "--editable", ROOT)
    _link_ros_files()


# kernels -------------------------------------------------------------------------------------------------------------


def _kernel_inputs(ros: machine.RosInstall | None) -> str:
    return _kernel_digest()


@cache
def _kernel_digest() -> str:
    """Digest of the sources as this process first found them, so that a change while kernels compile is noticed."""
    return _digest(files=compiled_sources())


def compiled_sources() -> list[Path]:
    """Sources that the warm-up imports, directly or not. If one of these changes, kernels are compiled again.

    The same rule as in collision_monitor/_jit/cache.py, which names the folders of the compiled kernels.
    """
    found, queue = set(), [ROOT / PACKAGE / "warm_up.py"]
    while queue:
        path = queue.pop()
        if path in found:
            continue
        found.add(path)
        for module, names in _IMPORT.findall(path.read_text()):
            base = ROOT.joinpath(*module.split("."))
            places = [base, *(base / name for name in re.findall(r"\w+", names))]
            files = [file for place in places for file in (place.with_suffix(".py"), place / "__init__.py")]
            queue += [file for file in files if file.is_file() and file not in found]
    return sorted(found)


def _compile_monitor(ros: machine.RosInstall | None, log: IO[str]) -> None:
    remove_old_kernels()
    _call(log, ros, PYTHON, "-m", "collision_monitor.warm_up", "monitor")


def _compile_options(ros: machine.RosInstall | None, log: IO[str]) -> None:
    _call(log, ros, PYTHON, "-m", "collision_monitor.warm_up", "options")


def _compile_functions(ros: machine.RosInstall | None, log: IO[str]) -> None:
    _call(log, ros, PYTHON, "-m", "collision_monitor.warm_up", "functions")


def remove_old_kernels() -> None:
    """Remove kernels older than a month, because each state of each module leaves a folder behind."""
    for folder in (VENV / "var" / "cache" / "collision_monitor").glob("*"):
        if folder.stat().st_mtime < time.time() - 30 * 86400:
            shutil.rmtree(folder, ignore_errors=True)


_PIP = ("compiler", "packages", "package")  # one after the other, because they write into the same folders

STAGES = (
    Stage("environment", "making .venv", _environment_inputs, _make_environment),
    Stage("compiler", "installing NumPy and numba", _compiler_inputs, _install_compiler, ("environment",)),
    Stage("packages", "installing ROS 2 and other packages", _packages_inputs, _install_packages, _PIP[:1]),
    Stage("monitor", "compiling the monitor", _kernel_inputs, _compile_monitor, _PIP[:1]),
    Stage("package", "installing collision-monitor", _package_inputs, _install_package, _PIP[:2]),
    Stage("messages", "building collision_monitor_msgs", _messages_inputs, _build_messages, _PIP[:2]),
    Stage("options", "compiling the monitor's options", _kernel_inputs, _compile_options, (_PIP[0], "monitor"), False),
    Stage("functions", "compiling other functions", _kernel_inputs, _compile_functions, (_PIP[0], "monitor"), False),
    Stage("tools", "installing tools for the tests", _tools_inputs, _install_tools, _PIP, False),
)

MODULES = ("scipy", "numba", "mcap", "rich", "matplotlib", "yaml", "rosbags", "colcon_core")
TOOL_MODULES = ("fcl", "pytest", "hypothesis", "mypy", "viser", "trimesh", "collada")

_HEALTH = """
import importlib.util, sys
stage = "packages"
try:
    import numpy, llvmlite.binding
    from rclpy.impl.implementation_singleton import rclpy_implementation
    from rclpy.serialization import serialize_message
    for name in {modules}:
        if importlib.util.find_spec(name) is None:
            raise ImportError(name)
    stage = "messages"
    from collision_monitor_msgs.msg import ObjectStateArray
    serialize_message(ObjectStateArray())
    stage = "tools"
    for name in {tools}:
        if importlib.util.find_spec(name) is None:
            raise ImportError(name)
    stage = "package"
    found = importlib.util.find_spec("collision_monitor")
    if found is None or {package!r} not in found.submodule_search_locations:
        raise ImportError("collision_monitor is not that of this folder")
except Exception as error:
    sys.exit(f"{{stage}}: {{error!r}}")
"""


def first_broken_stage(ros: machine.RosInstall | None, *, for_demo: bool = False) -> tuple[str, str] | None:
    """Import what the stages installed; return the first broken stage and the reason, or None."""
    if not os.access(PYTHON, os.X_OK):
        return "environment", f"{PYTHON} is not there"
    tool_modules = () if for_demo else TOOL_MODULES
    code = _HEALTH.format(modules=MODULES, tools=tool_modules, package=str(ROOT / "collision_monitor"))
    env = environment_variables(ros)
    answer = subprocess.run([PYTHON, "-P", "-c", code], env=env, capture_output=True, text=True, check=False)
    if answer.returncode:
        lines = answer.stderr.strip().splitlines() or [f"Python ended with {answer.returncode}"]
        stage = lines[-1].partition(":")[0]
        return (stage if stage in {"packages", "tools", "messages", "package"} else "environment"), lines[-1]
    if (place := missing_ros_file()) is not None:
        return "package", f"{place.relative_to(VENV)} is not there"
    return None
