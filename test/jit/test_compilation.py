"""A compilation is noticed, and the loading of a cached kernel is not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
from collision_monitor._jit import kernel
from collision_monitor._jit.compilation import telling_compilation

@kernel
def double(x):
    return 2.0 * x

@kernel
def triple(x):
    return 3.0 * x

with telling_compilation(print, 2, every=1e9):
    assert double(1.0) + triple(1.0) == 5.0
double(1)  # another type: compiled outside of the block
"""


LOADING = (
    PROGRAM.partition("with telling")[0]
    + """
from collision_monitor._jit.compilation import compiling_nothing

with compiling_nothing():
    print(double(1.0))
    print(triple(1.0))
    print("never")
print(triple(1.0))
"""
)


def test_only_what_is_compiled_already_is_called(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    environment = {"PYTHONPATH": ":".join(filter(None, sys.path)), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    program.write_text(LOADING.replace("with compiling_nothing():", "double(1.0)\nwith compiling_nothing():"))
    done = subprocess.run([sys.executable, program], env=environment, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("2.0\n3.0\n", "")


def test_only_a_compilation_is_noticed_and_only_the_first(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    environment = {"PYTHONPATH": ":".join(filter(None, sys.path)), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    outputs = [
        subprocess.run([sys.executable, program], env=environment, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert outputs == ["compiling the kernels, once for this machine and version\n", ""]


TALKING = """
import logging, sys
logging.basicConfig(stream=sys.stdout, level=logging.INFO, format="%(name)s")
from collision_monitor import _jit
from collision_monitor._jit.compilation import telling_compilation

def double(x):
    return 2.0 * x

double.__module__ = "collision_monitor.example"
double = _jit.kernel(double)
"""


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("double(1.0); double(1)", "collision_monitor"),
        ("with telling_compilation(lambda text: print('itself'), 1, 1e9): double(1.0)", "itself"),
        ("double.py_func(1.0)", ""),
    ],
)
def test_a_terminal_and_the_log_say_once_that_a_kernel_is_compiled(call: str, said: str, tmp_path: Path) -> None:
    environment = {"PYTHONPATH": ":".join(filter(None, sys.path)), "NUMBA_CACHE_DIR": str(tmp_path)}
    terminal, its = os.openpty()
    command = [sys.executable, "-c", f"{TALKING}\n{call}"]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=its, text=True)
    os.write(its, b"end")
    shown = os.read(terminal, 10_000).decode()
    os.close(terminal)
    os.close(its)
    assert done.returncode == 0, shown
    assert done.stdout.strip() == said
    assert shown.count("warm-up` compiles all") == (said == "collision_monitor")
