"""Types of features as the kernels write them: the values of Contact.msg."""

from __future__ import annotations

from typing import Final

UNKNOWN: Final = 0.0
VERTEX: Final = 1.0
EDGE: Final = 2.0
FACE: Final = 3.0
SURFACE: Final = 4.0
