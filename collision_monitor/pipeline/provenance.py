"""What the answers depend on besides the inputs and the profile: who replays a session compares this first."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from pathlib import Path

import llvmlite.binding
import numba
import numpy

from collision_monitor._version import VERSION

_PACKAGE = Path(__file__).parents[1]
_NO_PART_OF_THE_ANSWERS = ("cli", "report", "ros", "session", "world")


@cache
def provenance() -> dict[str, str]:
    """Versions, processor, and `determinism_key`: where two of these are equal, equal inputs give equal bytes."""
    facts = {
        "version": VERSION,
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "numba": numba.__version__,
        "machine": platform.machine(),
        "cpu": llvmlite.binding.get_host_cpu_name(),
    }
    digest = hashlib.blake2b("\n".join(facts.values()).encode(), digest_size=16)
    for path in sorted(_PACKAGE.rglob("*.py")):
        name = path.relative_to(_PACKAGE)
        if name.parts[0] not in _NO_PART_OF_THE_ANSWERS:
            digest.update(str(name).encode())
            digest.update(path.read_bytes())
    return {**facts, "determinism_key": digest.hexdigest()}
