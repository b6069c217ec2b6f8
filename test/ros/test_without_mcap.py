"""A ROS install with rosdep's packages alone can start the node: mcap, rosbags and their compression are not there."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import importlib.abc, sys

class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("mcap", "rosbags", "zstandard", "lz4"):
            raise ModuleNotFoundError(f"{name} is blocked", name=name)

sys.meta_path.insert(0, Blocked())
import rclpy
from collision_monitor.ros.monitor.monitor_node import MonitorNode
from collision_monitor.ros.process import StopRequest
rclpy.init(args=["--ros-args", *sys.argv[1:]])
node = MonitorNode(StopRequest())
assert node.start()
recording = node._monitoring._recording
print(recording, recording.status().get("recording_error", ""))
"""


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, timeout=300)


def test_the_node_starts_and_says_what_recording_needs(ros_domain_id: int, tmp_path: object) -> None:
    done = run()
    assert done.returncode == 0, done.stderr
    assert "not recording" in done.stdout
    done = run("-p", f"record:={tmp_path}/run.mcap")
    assert done.returncode == 0, done.stderr
    assert "pip install mcap" in done.stdout
