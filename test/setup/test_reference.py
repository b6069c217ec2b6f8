"""The reference of the Python API names every public name. `make docs` builds it, which takes 20 s."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

from collision_monitor.shapes.registry import KINDS

SOURCE = Path(__file__).parents[2] / "docs" / "reference"
MODULES = tuple(f"collision_monitor{inner}" for inner in ("", ".response", ".world", ".session", ".sources"))


def entries() -> set[str]:
    """Full names of the entries of all pages."""
    found = set()
    for page in SOURCE.glob("*.rst"):
        module = ""
        if "{shapes}" in page.read_text():  # conf.py puts an entry for each kind there
            found |= {f"collision_monitor.{kind.shape.__name__}" for kind in KINDS}
        for directive, name in re.findall(r"^\.\. (\w+):: ([\w.]+)", page.read_text(), re.MULTILINE):
            if directive == "currentmodule":
                module = name
            elif directive == "automodule":
                found.add(name)
            elif directive.startswith("auto"):
                found.add(f"{module}.{name}")
    return found


ENTRIES = entries()


@pytest.mark.parametrize("module", MODULES)
def test_every_public_name_has_an_entry(module: str) -> None:
    names = {f"{module}.{name}" for name in import_module(module).__all__}
    assert names - ENTRIES == set()


def test_every_entry_is_a_public_name() -> None:
    public = {f"{module}.{name}" for module in MODULES for name in import_module(module).__all__}
    assert ENTRIES - public - set(MODULES) == set()


def test_every_page_is_in_the_table_of_contents() -> None:
    listed = re.findall(r"^   (\w+)$", (SOURCE / "index.rst").read_text(), re.MULTILINE)
    assert {page.stem for page in SOURCE.glob("*.rst")} == {*listed, "index"}
