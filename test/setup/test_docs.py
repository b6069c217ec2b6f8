"""The examples of the docs run, and the names and tests that docs/methods.md lists exist."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

import collision_monitor as cm

ROOT = Path(__file__).parents[2]
METHODS = (ROOT / "docs" / "methods.md").read_text()
EXAMPLES = {
    f"{name} {k}": text
    for name in ("geometry", "response")
    for k, text in enumerate(
        re.findall(r"```python\n(# example\n.*?)```", (ROOT / "docs" / f"{name}.md").read_text(), re.DOTALL)
    )
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs_and_its_assertions_hold(name: str) -> None:
    assert "assert" in EXAMPLES[name]
    exec(compile(EXAMPLES[name], name, "exec"), {})


def test_there_are_examples() -> None:
    assert sum(name.startswith("geometry") for name in EXAMPLES) >= 6
    assert any(name.startswith("response") for name in EXAMPLES)


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`cm\.([a-zA-Z_.]+)", METHODS))))
def test_every_public_name_resolves(name: str) -> None:
    found: object = cm
    for part in name.split("."):
        found = getattr(found, part)


MODULES = sorted(set(re.findall(r"`((?:geometry|monitor|broad_phase|detection)\.[\w.]+)`", METHODS)))


@pytest.mark.parametrize("name", MODULES)
def test_every_module_imports(name: str) -> None:
    assert import_module(f"collision_monitor.{name}")


@pytest.mark.parametrize(("name", "functions"), re.findall(r"`([\w.]+)` \(((?:`\w+`(?:, )?)+)\)", METHODS))
def test_every_function_that_is_listed_behind_a_module_is_there(name: str, functions: str) -> None:
    for function in re.findall(r"\w+", functions):
        assert callable(getattr(import_module(f"collision_monitor.{name}"), function))


def test_functions_are_listed_behind_modules() -> None:
    assert len(re.findall(r"` \(`", METHODS)) >= 5


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`(test/\S+\.py)`", METHODS))))
def test_every_listed_test_exists(path: str) -> None:
    assert (ROOT / path).exists()
