"""The examples of README.md run, the parameter table is complete, and the linked files and make targets exist."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from collision_monitor.settings.profile import Profile

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def test_the_python_example_predicts_the_impact() -> None:
    example = re.findall(r"```python\n(.*?)```", README, re.DOTALL)[0]
    answer = subprocess.run([sys.executable, "-c", example], capture_output=True, text=True, timeout=300)
    assert answer.returncode == 0, answer.stderr
    times = re.fullmatch(r"cart meets ball in (\S+) to (\S+) s\n", answer.stdout)
    assert times, answer.stdout
    # The cart's front is at 0.5 m, the ball's near side at 3.5 m; they close 3 m at 2 m/s.
    assert float(times[1]) <= 1.5 <= float(times[2]) + 1e-3


def test_the_examples_of_two_shapes_run(tmp_path: Path) -> None:
    example = re.findall(r"```python\n(.*?)```", README, re.DOTALL)[1]
    stand_ins = (
        "import collision_monitor as cm; a = b = mesh_a = mesh_b = cm.Box((1, 1, 1)); pose_a = cm.Pose(); "
        "pose_b = cm.Pose((3, 0, 0)); x = [[0.0, 0.0, 0.0]] * 8\n"
    )
    checks = "assert i.status == 'hit' and i.lower <= 2.81 <= i.upper + 0.01\n"
    answer = subprocess.run(
        [sys.executable, "-c", stand_ins + example + checks],
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "agg"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert answer.returncode == 0, answer.stderr


@pytest.mark.parametrize("setting", Profile.fields(), ids=lambda setting: setting.name)
def test_the_parameter_table_has_every_setting_with_its_default(setting: Profile) -> None:
    default = setting.default
    text = {
        tuple: lambda: ", ".join(f"{x:g}" for x in default),
        bool: lambda: str(default).lower(),
        str: lambda: f"`{default}`" if default else "empty",
    }.get(setting.type, lambda: f"{default:g}")()
    assert f"| `{setting.name}` | {text} |" in (ROOT / "docs" / "node.md").read_text()


def test_every_linked_file_exists() -> None:
    for document in ("README.md", "CONTRIBUTING.md", "docs/node.md", "docs/architecture.md", "docs/safety.md"):
        for target in re.findall(r"\]\((?!http)([^)#]+)(?:#[^)]*)?\)", (ROOT / document).read_text()):
            assert (ROOT / document).parent.joinpath(target).exists(), f"{document} links to {target}"


def test_every_make_target_that_is_named_exists() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for document in ("README.md", "CONTRIBUTING.md", "docs/safety.md"):
        named = set(re.findall(r"(?:^    |`)make ([a-z-]+)", (ROOT / document).read_text(), re.MULTILINE))
        assert named <= targets, f"{document} names {sorted(named - targets)}"


def test_plain_make_lists_every_target() -> None:
    listed = subprocess.run(["make", "-s"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert re.findall(r"^  make ([a-z-]+) +\S", listed, re.MULTILINE) == targets
