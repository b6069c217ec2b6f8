"""The programs of examples/ run, each by the command in its first line, and show what they promise."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

PROMISES = {
    "robot_from_odometry.py": r"robot meets wall in \d\.\d\d to \d\.\d\d s",
    "robot_on_path.py": r"robot meets crate in 1\.\d\d to \d\.\d\d s",
    "tracked_objects.py": r"car meets traffic_pedestrian_1 in \d\.\d\d to \d\.\d\d s",
    "arm/gate.py": r"(?s)gate: stops: arm/\w+ and post: .* s of the plan.*refused a plan: arm/\w+ and post",
    "brake_before_impact.py": r"stopped 0\.\d\d m before the wall at",
}


@pytest.mark.parametrize("name", PROMISES)
def test_the_example_shows_what_it_promises(name: str, ros_domain_id: int) -> None:
    path = ROOT / "examples" / name
    assert path.read_text().startswith(f'""".venv/bin/python examples/{name}\n')
    answer = subprocess.run([sys.executable, path], cwd=ROOT, capture_output=True, text=True, timeout=180)
    assert answer.returncode == 0, answer.stderr
    assert re.search(PROMISES[name], answer.stdout), answer.stdout + answer.stderr
