"""The wheel that `pip install .` installs gives the whole Python API without ROS."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
BUILT_FROM = ("collision_monitor", "config", "launch", "resource")
FILES = ("pyproject.toml", "setup.py", "setup.cfg", "package.xml", "README.md")

PROGRAM = """
import importlib.abc, sys

class WithoutRos(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("rclpy", "collision_monitor_msgs", "rcl_interfaces", "ament_index_python"):
            raise ModuleNotFoundError(f"{name} is blocked", name=name)

sys.meta_path.insert(0, WithoutRos())
import collision_monitor as cm
assert cm.__file__.startswith(sys.argv[1]), cm.__file__
for name in cm.__all__:
    getattr(cm, name)
assert cm.contact(cm.Sphere(1), cm.Pose(), cm.Sphere(1), cm.Pose((3, 0, 0))).signed_distance == 1.0
from collision_monitor.cli.main import main
try:
    main(["world", "--list"])
except SystemExit as ended:
    assert not ended.code, ended.code
assert main(["sources"]) == 1
"""


def test_the_wheel_works_without_ros(tmp_path: Path) -> None:
    source, target = tmp_path / "source", tmp_path / "installed"
    for name in BUILT_FROM:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in FILES:
        shutil.copy(ROOT / name, source / name)
    options = ("--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", tmp_path)
    command = [sys.executable, "-m", "pip", "wheel", *options, source]
    subprocess.run(command, check=True, timeout=120)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as content:
        names = content.namelist()
        content.extractall(target)
    for needed in ("py.typed", "session/mcap/definitions.txt", "ros/shared_memory.xml", "_jit/libraries.py"):
        assert f"collision_monitor/{needed}" in names
    # without compilation: kernels in another place would be compiled anew, for a minute
    environment = {**os.environ, "PYTHONPATH": str(target), "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(target)],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "expected ROS 2, got no module 'rclpy': source a ROS 2 install" in done.stderr
