"""Runs the examples in the docstrings of the public names, and compares what they print."""

from __future__ import annotations

import doctest
import inspect
from typing import Any

import matplotlib
import pytest

import collision_monitor as cm

matplotlib.use("agg")

PUBLIC = {name: getattr(cm, name) for name in cm.__all__}
ERRORS = {name for name, it in PUBLIC.items() if inspect.isclass(it) and issubclass(it, Exception)}
WITHOUT = {"__version__"} | ERRORS
"""Names without an example in their docstrings."""

FINDER = doctest.DocTestFinder(recurse=True)
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def examples(name: str) -> list[doctest.DocTest]:
    """Examples of a public name, and of the methods of a class."""
    value: Any = getattr(cm, name)
    module = value if inspect.ismodule(value) else inspect.getmodule(value)
    globs = {**(vars(module) if module else {}), "cm": cm}
    return [test for test in FINDER.find(value, name, globs=globs) if test.examples]


@pytest.mark.parametrize("name", [name for name in cm.__all__ if name not in WITHOUT])
def test_the_example_of_a_public_name_prints_what_it_says(name: str) -> None:
    found = examples(name)
    assert found, f"cm.{name}: expected an example in its docstring"
    runner = doctest.DocTestRunner(optionflags=FLAGS, verbose=False)
    for each in found:
        runner.run(each)
    assert runner.failures == 0
