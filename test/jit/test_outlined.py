"""Tests that an outlined function is compiled once for all kernels, and that their cached code finds it again."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., list[str]]

MODULE = """
from collision_monitor._jit import device, kernel, outlined

@outlined
def core(values, k):
    if values[k] < 0.0:
        return -1.0, k
    return 2.0 * values[k], k + 1

@device
def through(values, k):
    return core(values, k)[0] + 1.0

@outlined
def above(values, k):
    return through(values, k) + 1.0

@kernel
def direct(values, k):
    return core(values, k)[0]

@kernel
def nested(values, k):
    return above(values, k) + through(values, k)
"""

PROGRAM = """
import sys
import numpy as np
from numba.core import event

class Listener(event.Listener):
    def on_start(self, e): print(e.data["dispatcher"].py_func.__name__, end=" ")
    def on_end(self, e): pass

event.register("numba:compile", Listener())
import example
values = np.array([3.0, -1.0])
for name in sys.argv[1:]:
    print(getattr(example, name)(values, 0), end=" ")
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the module and of the caches."""
    folder = tmp_path_factory.mktemp("outlined")
    (folder / "example.py").write_text(MODULE)
    return folder


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    def run(cache: str, *names: str) -> list[str]:
        """Names of the functions that were compiled, and results of the kernels."""
        path = os.pathsep.join([str(folder), *filter(None, sys.path)])
        environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(folder / cache)}
        command = [sys.executable, "-c", PROGRAM, *names]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    return run


@pytest.fixture(scope="module")
def first(run: Run) -> list[str]:
    """What the first process compiled and answered."""
    return run("one", "direct", "nested")


def test_an_outlined_function_is_compiled_once_and_loaded_with_its_callers(
    run: Run, folder: Path, first: list[str]
) -> None:
    assert first == ["direct", "core", "6.0", "nested", "above", "through", "15.0"]
    assert run("one", "nested", "direct") == ["15.0", "6.0"]
    assert len(list(folder.glob("one/*/core-*.outlined"))) == 1


def test_a_lost_file_of_an_outlined_function_costs_only_its_own_compilation(
    run: Run, folder: Path, first: list[str]
) -> None:
    (lost,) = folder.glob("one/*/core-*.outlined")
    lost.unlink()
    assert run("one", "nested", "direct") == ["core", "15.0", "6.0"]
    assert run("one", "nested", "direct") == ["15.0", "6.0"]


def test_kernels_call_code_that_another_process_compiled(run: Run, folder: Path, first: list[str]) -> None:
    """Two processes that compile at the same time both write the file, and the last one stays."""
    run("two", "nested")  # in another order, so that numba counts its functions otherwise
    (one,), (two,) = (folder.glob(f"{cache}/*/core-*.outlined") for cache in ("one", "two"))
    one.write_bytes(two.read_bytes())
    assert run("one", "direct", "nested") == ["6.0", "15.0"]
