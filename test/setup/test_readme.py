"""The examples of README.md run, the parameter table is complete, and the make targets exist."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from collision_monitor.cli.main import main
from collision_monitor.settings.profile import Profile
from collision_monitor.settings.yaml_file import read_yaml
from collision_monitor.shapes.registry import KINDS
from collision_monitor.sources import load_mapping

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
PYTHON = (ROOT / "docs" / "python.md").read_text()


def blocks(text: str, language: str) -> list[str]:
    """The blocks of a Markdown text in this language."""
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def test_it_can_be_read_in_four_minutes() -> None:
    assert len(README.split()) <= 900


def test_the_python_example_predicts_the_impact() -> None:
    (example,) = blocks(README, "python")
    answer = subprocess.run([sys.executable, "-c", example], capture_output=True, text=True, timeout=300)
    assert answer.returncode == 0, answer.stderr
    times = re.search(r"prediction: cart and ball in (\S+) to (\S+) s\n", answer.stdout)
    assert times, answer.stdout
    # The cart's front is at 0.5 m, the ball's near side at 3.5 m; they close 3 m at 2 m/s.
    assert float(times[1]) <= 1.5 <= float(times[2]) + 1e-3


def test_the_robot_in_five_lines_is_a_sources_file(tmp_path: Path) -> None:
    (text,) = blocks(README, "yaml")
    assert len(text.splitlines()) == 5
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    mapping = load_mapping(path)
    assert set(mapping.topics) == {"/odom"}
    assert read_yaml(path) == read_yaml(ROOT / "examples" / "robot_from_odometry.yaml")  # which examples run


def test_the_names_of_commands_and_their_options_exist(capsys: pytest.CaptureFixture[str]) -> None:
    text = README + (ROOT / "docs" / "commands.md").read_text() + (ROOT / "docs" / "start.md").read_text()
    named: dict[str, set[str]] = {}
    for command, options in re.findall(r"collision-monitor ([a-z][a-z-]+)([^\n#`]*)", text):
        named.setdefault(command, set()).update(re.findall(r"--[a-z-]+", options))
    assert {"run", "view", "replay", "salvage", "tune"} <= named.keys()
    for command, options in named.items():
        with pytest.raises(SystemExit) as end:
            main([command, "--help"])
        usage = capsys.readouterr().out
        assert end.value.code == 0
        assert {option for option in options if not re.search(rf"{option}\b", usage)} == set(), command


def test_the_table_of_shapes_names_every_kind() -> None:
    (table,) = re.findall(r"^## Shapes\n(.*?)^## ", PYTHON, re.DOTALL | re.MULTILINE)
    for kind in KINDS:
        given = inspect.signature(kind.shape.__init__ if "__new__" in vars(kind.shape) else kind.shape).parameters
        named = re.findall(rf"`{kind.shape.__name__}\(([^)]*)\)`", table)
        assert len(named) == 1, kind.shape.__name__
        assert set(named[0].split(", ")) <= set(given), kind.shape.__name__


def test_the_examples_of_two_shapes_and_of_batches_run(tmp_path: Path) -> None:
    example, batches = blocks(PYTHON, "python")
    checks = "assert i.status == 'hit' and i.lower <= 2.81 <= i.upper + 0.01\n"
    checks_of_batches = "assert len(found) == 100_000 and found.signed_distance[-1] == 8.0\n"
    answer = subprocess.run(
        [sys.executable, "-c", example + checks + batches + checks_of_batches],
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


def test_every_make_target_that_is_named_exists() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for document in ("README.md", "CONTRIBUTING.md", "docs/safety.md"):
        named = set(re.findall(r"(?:^    |`)make ([a-z-]+)", (ROOT / document).read_text(), re.MULTILINE))
        assert named <= targets, f"{document} names {sorted(named - targets)}"


def test_plain_make_lists_every_target() -> None:
    listed = subprocess.run(["make", "-s"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert re.findall(r"^  make ([a-z-]+) +\S", listed, re.MULTILINE) == targets


def test_the_tests_of_make_test_fast_exist() -> None:
    command = subprocess.run(["make", "-n", "test-fast"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    paths = re.findall(r"\btest/\S+", command)
    assert len(paths) > 10
    assert [path for path in paths if not (ROOT / path).exists()] == []
