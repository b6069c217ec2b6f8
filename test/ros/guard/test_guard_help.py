"""`--help` of the executables for `ros2 run`: a text and exit code 0, without ROS."""

from __future__ import annotations

import subprocess
import sys

import pytest

from collision_monitor.ros.guard.guard_options import NAMES

WITHOUT_ROS = """
import sys
from collision_monitor.ros.executables import {name}
code = {name}(["{name}", *{arguments}])
assert "rclpy" not in sys.modules and "numba" not in sys.modules
sys.exit(code)
"""


@pytest.mark.parametrize("name", ["guard", "monitor", "world"])
@pytest.mark.parametrize("arguments", [["--help"], ["-h"], ["--help", "--ros-args", "-p", "a:=1"]])
def test_help_is_printed(name: str, arguments: list[str]) -> None:
    program = WITHOUT_ROS.format(name=name, arguments=arguments)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"usage: {name}")
    if name == "guard":
        assert all(f"  {each} " in done.stdout for each in NAMES)
    assert max(map(len, done.stdout.splitlines())) <= 120
