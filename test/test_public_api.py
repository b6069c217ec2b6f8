"""Tests of the names of `collision_monitor`: all of them exist, and none is imported before its first use."""

from __future__ import annotations

import subprocess
import sys

import pytest

import collision_monitor as cm


@pytest.mark.parametrize("name", cm.__all__)
def test_a_name_is_listed_and_resolves(name: str) -> None:
    assert name in dir(cm)
    assert getattr(cm, name) is not None


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'contakt'"):
        cm.contakt  # noqa: B018


def test_the_package_imports_no_kernels() -> None:
    code = "import sys, collision_monitor as cm; dir(cm); print({'numba', 'numpy', 'scipy'} & set(sys.modules))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout == "set()\n"
