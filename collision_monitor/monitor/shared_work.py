"""Share the rows of an array between the threads of a step. Kernels release Python's lock, so they run at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Work = TypeVar("Work")
Answer = TypeVar("Answer")


def share(
    pool: ThreadPoolExecutor,
    part: Callable[[NDArray[Any], Work], Answer],
    rows: NDArray[Any],
    scratch: Sequence[Work],
) -> list[Answer]:
    """Compute `part` of equal parts of the rows, one for each scratch memory. Return the answers in order.

    The calling thread computes the first part: to wake another thread costs as much as predicting 100 pairs.
    """
    own, *others = np.array_split(rows, len(scratch))
    waiting = [pool.submit(part, *each) for each in zip(others, scratch[1:], strict=True)]
    try:
        first = part(own, scratch[0])
    finally:
        wait(waiting)  # also after an error, because the next step writes to the same memory
    return [first, *(each.result() for each in waiting)]
