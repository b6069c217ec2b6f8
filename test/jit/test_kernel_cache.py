"""Tests that a cached kernel which cannot be rebuilt is compiled again."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

POINT = "from typing import Any, NamedTuple\n\nclass Point(NamedTuple):\n    x: Any\n"
KERNEL = "from collision_monitor._jit import kernel\n\n@kernel\ndef doubled(point):\n    return 2.0 * point.x\n"


def _doubled(folder: Path, home: str) -> str:
    """Call the kernel with a Point of the module `home`, in a process of its own."""
    code = f"from doubling import doubled\nfrom {home} import Point\nprint(doubled(Point(1.5)))"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": str(folder)}
    answer = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


def test_a_kernel_whose_argument_type_has_moved_is_compiled_again(tmp_path: Path) -> None:
    (tmp_path / "doubling.py").write_text(KERNEL)
    (tmp_path / "home.py").write_text(POINT)
    assert _doubled(tmp_path, "home") == "3.0\n"
    (tmp_path / "home.py").rename(tmp_path / "new_home.py")
    assert _doubled(tmp_path, "new_home") == "3.0\n"
