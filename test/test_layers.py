"""Tests that imports point in one direction, and that all modules below the node work without ROS."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Mapping, Set
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path
from typing import Final

import pytest

from collision_monitor._jit.imports import direct_imports

NAME: Final = "collision_monitor"
PACKAGE = Path(__file__).parents[1] / NAME

FLOORS: Final = (
    {"_jit", "errors", "tolerances", "records", "_version"},
    {"checks"},
    {"settings", "geometry"},
    {"shapes"},
    {"geometry.lecture"},
    {"broad_phase", "narrow_phase", "response"},
    {"meshes", "motion"},
    {"impact"},
    {"objects", "uncertainty", "robots"},
    {"query", "detection", "monitor", "codec", "world"},
    {"alerts"},
    {"pipeline", "warm_up"},
    {"sources", "session"},
    {"accuracy", "report", "view", "ros"},
    {"cli"},
    {"__init__", "__main__"},
)
"""Folders and files of the package by floor, from the bottom up; each may import itself and the floors below."""

SIDEWAYS: Final = {
    ("sources.importing", "session"): "what a bag is imported into is a session",
    ("sources.bag", "session"): "a bag of MCAP is known by its first bytes",
    ("sources.storage.mcap_storage", "session"): "a bag of MCAP has the records of a session",
    ("sources.storage.packed", "session"): "what is packed in a bag has the limits of the chunks of a session",
    ("sources.storage.ros1_storage", "session"): "likewise",
}
"""Allowed imports of a module from another folder of the same floor, with the reason."""

WITH_ROS = ("ros", "cli", "__main__")

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


def _dotted(path: Path) -> str:
    """Dotted name such as `collision_monitor.shapes.pose`; a folder's `__init__` has the folder's name."""
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


FILES: Final = {_dotted(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def top(module: str) -> str:
    """Folder or file directly below the package that contains a module, or its inner room if that has its own floor."""
    if module == NAME:
        return "__init__"
    folder, _, inner = module.removeprefix(f"{NAME}.").partition(".")
    room = f"{folder}.{inner.split('.')[0]}"
    return room if floor(room) is not None else folder


def floor(name: str) -> int | None:
    """Floor of a folder, an inner room or a file, or None if FLOORS does not list it."""
    return next((height for height, names in enumerate(FLOORS) if name in names), None)


@cache
def imported(path: Path) -> frozenset[str]:
    """Modules of this package that a source file imports, also in functions and for type checkers only."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}, line {node.lineno}: expected an import by its full name"
            members = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {member if member in FILES else str(node.module) for member in members}
    return frozenset(name for name in found if name.split(".")[0] == NAME)


def test_each_module_is_on_a_floor() -> None:
    assert {top(module) for module in FILES if floor(top(module)) is None} == set(), "add them to FLOORS"


def test_imports_point_down() -> None:
    wrong = []
    for module, path in FILES.items():
        own = top(module)
        for other in sorted(imported(path)):
            height, below = floor(own), floor(top(other))
            is_inside = top(other) == own or (module.removeprefix(f"{NAME}."), top(other)) in SIDEWAYS
            if height is None or below is None or not (below < height or is_inside):
                wrong.append(f"{module} imports {other}, which is not below it")
    assert wrong == []


def circle(imports: Mapping[str, Set[str]]) -> list[str]:
    """Return modules each of which imports the next one, and the first one again at the end; empty: there are none."""
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))  # the sorter lists each module behind one that imports it
    return []


def test_no_modules_import_each_other_in_a_circle() -> None:
    found = circle({module: imported(path) & FILES.keys() - {module} for module, path in FILES.items()})
    assert not found, f"a circle of imports, also counting those inside functions: {' -> '.join(found)}"


def test_a_circle_is_found_and_named_in_its_direction(tmp_path: Path) -> None:
    names = ("a", "b", "c", "d")
    inside = "def late():\n    from collision_monitor.shapes import pose\n"
    (tmp_path / "late.py").write_text(inside)
    assert imported(tmp_path / "late.py") == {f"{NAME}.shapes.pose"}, "imports inside functions count"
    found = circle(dict(zip(names, ({"b"}, {"c"}, {"d"}, {"b"}), strict=True)))
    assert found[0] == found[-1] and set(found) == {"b", "c", "d"}
    assert all(pair in {("b", "c"), ("c", "d"), ("d", "b")} for pair in pairwise(found))
    assert circle(dict(zip(names, ({"b"}, {"c"}, {"d"}, set()), strict=True))) == []


@pytest.mark.parametrize(("module", "other"), SIDEWAYS)
def test_the_exceptions_are_needed(module: str, other: str) -> None:
    path = FILES[f"{NAME}.{module}"]
    assert floor(top(f"{NAME}.{module}")) == floor(other)
    assert other in map(top, imported(path)), f"{module} does not import {other} any more: take it out of SIDEWAYS"


def test_the_picture_of_the_floors_shows_every_folder() -> None:
    picture = ast.parse((PACKAGE.parent / "docs" / "draw_architecture.py").read_text())
    drawn: set[str] = set()
    for node in picture.body:
        if isinstance(node, ast.AnnAssign) and getattr(node.target, "id", "") == "FLOORS":
            assert node.value is not None
            drawn = {name for floor in ast.literal_eval(node.value) for name, _ in floor}
    folders = {name for names in FLOORS[1:-1] for name in names}
    assert drawn == folders, "change FLOORS in docs/draw_architecture.py and run it"


def test_the_import_graph_that_names_kernels_and_recordings_is_that_of_python() -> None:
    ours = {module: direct_imports(module) for module in FILES}
    assert ours == {module: imported(path) for module, path in FILES.items()}


def test_all_but_the_node_and_the_command_line_imports_without_ros() -> None:
    modules = [module for module in FILES if top(module) not in WITH_ROS]
    assert len(modules) > 20
    command = [sys.executable, "-c", WITHOUT_ROS, *modules]
    answer = subprocess.run(command, cwd=PACKAGE.parent, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
