"""Tests that the source stays in order: small folders, files and functions, and one meaning for each public name."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Final

import house
import pytest

MOST_MODULES: Final = 25
"""Modules of a folder."""

MOST_LINES: Final = 450
"""Lines of a file."""

MOST_LINES_OF_MONITOR: Final = 300
"""Lines of the class Monitor: the door, and the list of the stages."""

NAMESAKES: Final = {
    "Contacts": "the contacts of `cm.contacts`, and those of `cm.response`: a user meets them in different places",
    "add_parser": "one in each file of a command",
    "main": "one in each program",
}
"""Public names that more than one module may define, with the reason."""

LONG_FILES: Final = {"collision_monitor/uncertainty/sampled_impacts.py"}
"""Files that are longer for the time being."""

LONG_FUNCTIONS: Final = {
    *("impact_probabilities", "plane_probabilities", "_lay_planes", "design_point"),
    *("sat", "farthest_vertex", "tree_impact", "solid_range", "fit_box", "solid_contact"),
}
"""Functions that are longer than `house.LONGEST_FUNCTION` for the time being."""

CALLED_FROM_OUTSIDE: Final = {
    *("set_env", "get_pointer_to_function"),  # by numba
    "pytest_configure",
}
"""Definitions that other packages call by their names."""

CALLED_BY_ATTACKS: Final = {"read_failure"}
"""What `make fuzz` calls, so that people can play a reported failure again."""

PACKAGE: Final = house.modules()


def test_no_folder_holds_more_modules_than_one_looks_through() -> None:
    assert {folder: n for folder, n in house.modules_by_folder(PACKAGE).items() if n > MOST_MODULES} == {}


def test_the_monitor_is_a_door() -> None:
    assert house.class_lines(house.MONITOR, "Monitor") <= MOST_LINES_OF_MONITOR


def test_each_public_name_is_defined_in_one_module() -> None:
    found = house.namesakes(PACKAGE)
    others = {name: paths for name, paths in found.items() if name not in NAMESAKES}
    assert others == {}, "give each of them a name that says which one it is"
    assert found.keys() == NAMESAKES.keys(), "take out of NAMESAKES what has one module only"


def test_no_file_is_too_long_to_read_in_one_sitting() -> None:
    assert house.long_files(PACKAGE, MOST_LINES).keys() <= LONG_FILES


def test_no_function_is_too_long_to_see_at_once() -> None:
    assert {each.name for each in house.long_functions(PACKAGE)} <= LONG_FUNCTIONS


def test_every_definition_is_used_outside_of_the_tests() -> None:
    found = {each.split()[1] for each in house.unused(PACKAGE, house.texts_of_users())}
    known = CALLED_FROM_OUTSIDE | CALLED_BY_ATTACKS
    assert found <= known, "remove them, or say in docs what they are for"
    assert found >= CALLED_FROM_OUTSIDE


def module(text: str, path: str = "package/module.py") -> house.Module:
    return house.Module(path, text, ast.parse(text))


def test_namesakes_are_public_functions_and_classes_of_different_modules() -> None:
    own = "def _own(): ...\nLIMIT = 1\n"
    a = module(f"{own}class Scene: ...\ndef run(): ...\nclass Other:\n    def inner(self): ...", "a.py")
    b = module(f"{own}try:\n    class Scene: ...\nexcept ImportError:\n    class Scene: ...", "b.py")
    c = module("if True:\n    def run(): ...\ndef inner(): ...", "c.py")
    assert house.namesakes([a, b, c]) == {"Scene": ["a.py", "b.py"], "run": ["a.py", "c.py"]}


@pytest.mark.parametrize(("lines", "is_long"), [(house.LONGEST_FUNCTION, False), (house.LONGEST_FUNCTION + 1, True)])
def test_a_function_is_counted_from_its_first_line_to_its_last(lines: int, is_long: bool) -> None:
    text = "class Some:\n    @property\n    def long(self):\n" + "        pass\n" * (lines - 1)
    expected = [house.LongFunction(lines, "package/module.py", "long")] if is_long else []
    assert house.long_functions([module(text)]) == expected


def test_what_nothing_uses_is_found() -> None:
    a = module("LIMIT = 1\nUNUSED = 2\ndef called(): return LIMIT\ndef idle(): return idle_too\n", "a.py")
    b = module("from a import called\nclass Made:\n    def told(self): ...\n    def silent(self): ...\n", "b.py")
    c = module(
        "class Hook(Foreign):\n    def on_call(self): ...\ndef looked_up(): ...\nNAMES = ('looked_up',)\n", "c.py"
    )
    found = ["a.py UNUSED", "a.py idle", "b.py silent", "c.py NAMES"]
    assert house.unused([a, b, c], ["Made().told()", "`Hook` is told"]) == found


def test_folders_are_counted_without_their_inner_folders() -> None:
    paths = ["p/__init__.py", "p/a.py", "p/b.py", "p/inner/__init__.py", "p/inner/c.py"]
    assert house.modules_by_folder([module("", path) for path in paths]) == {"p": 2, "p/inner": 1}


def test_the_program_prints_each_figure(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["house.py", "--lists"])
    found = house.figures(PACKAGE)
    monkeypatch.setattr(house, "figures", lambda _: found)
    house.main()
    printed = capsys.readouterr().out
    for name, value, _ in found:
        assert f"{name} {value}" in " ".join(printed.split())
    assert len(list(Path(house.PACKAGE).rglob("*.py"))) == len(PACKAGE)
