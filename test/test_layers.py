"""Imports run one way, and everything below the node works where there is no ROS at all."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "collision_monitor"
MODULES = sorted(
    ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
    for path in PACKAGE.rglob("*.py")
    if path.name != "__main__.py"
)
WITH_ROS = ("ros", "cli")

LAYERS = (
    {"geometry"},
    {"broad_phase", "narrow_phase"},
    {"prediction"},
    {"monitor"},
    {"pipeline"},
    {"session"},
    {"report"},
    {"ros", "cli"},
)
"""From the bottom up. A module imports its own layer and those below; the rest is free (errors, records …)."""

WITHOUT_ROS = """
import importlib, importlib.abc, sys

class NoRos(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("rclpy", "collision_monitor_msgs", "rcl_interfaces", "visualization_msgs"):
            raise ModuleNotFoundError(f"{name} is blocked", name=name)

sys.meta_path.insert(0, NoRos())
for name in sys.argv[1:]:
    importlib.import_module(name)
"""


def layer(name: str) -> int | None:
    """The layer that a name below `collision_monitor.` belongs to, None for those that are free."""
    return next((height for height, names in enumerate(LAYERS) if name in names), None)


def imported(path: Path) -> set[str]:
    """What a source file imports from this package: `geometry` for `collision_monitor.geometry.pose`."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            if node.module == "collision_monitor":
                names |= {f"collision_monitor.{alias.name}" for alias in node.names}
            names.add(node.module)
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return {name.split(".")[1] for name in names if name.startswith("collision_monitor.")}


@pytest.mark.parametrize("module", [module for module in MODULES if module.count(".")])
def test_imports_point_down(module: str) -> None:
    own = layer(module.split(".")[1])
    if own is None:
        return
    path = PACKAGE.parent / Path(*module.split("."))
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    upward = {name for name in imported(source) if (layer(name) or 0) > own}
    assert not upward, f"{module} imports {sorted(upward)}, which lies above it"


def test_all_but_the_node_and_the_command_line_imports_without_ros() -> None:
    modules = [module for module in MODULES if module.split(".")[1:2] not in [[name] for name in WITH_ROS]]
    assert len(modules) > 20
    command = [sys.executable, "-c", WITHOUT_ROS, *modules]
    answer = subprocess.run(command, cwd=PACKAGE.parent, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
