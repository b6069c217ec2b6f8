"""Tests that LLVM may change the functions inside a kernel without an effect on other code with the same functions."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

LOOP = """
    for n in range(k + 1):
        for m in range({0}, values.size):
            total += sqrt(values[m] + {0}.0) / (n + values[m - {0}] + 1.0) if m % {0} else values[m] - total
"""

MODULE = (
    """
from math import sqrt
from numba import prange
from collision_monitor._jit import device, kernel, parallel_kernel

@device
def inner(unread, values, k):  # so large that LLVM does not inline it
    total = 0.0
"""
    + "".join(LOOP.format(k) for k in range(1, 10))
    + """
    return total

@kernel
def serial(unread, values, out):
    for k in range(out.size):
        out[k] = inner(unread, values, k) + inner(unread, values, 2 * k) + inner(unread, values, 3 * k)
    return 0

@parallel_kernel
def parallel(unread, values, out):
    for k in prange(out.size):
        out[k] = inner(unread, values, k) + inner(unread, values, 2 * k) + inner(unread, values, 3 * k)
    return 0
"""
)

PROGRAM = """
import numpy as np
import example
for name in ("serial", "parallel"):
    out = np.zeros(4)
    getattr(example, name)(np.zeros(3), np.arange(20.0), out)
    print(*out)
"""


def test_a_parallel_kernel_does_not_call_the_functions_inside_another_kernel(tmp_path: Path) -> None:
    """LLVM drops unread arguments there. Found by name, one read the wrong ones: two threads found no contact."""
    (tmp_path / "example.py").write_text(MODULE)
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for _ in range(2):  # compiled, then loaded
        command = [sys.executable, "-c", PROGRAM]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        serial, parallel = done.stdout.splitlines()
        assert serial == parallel
