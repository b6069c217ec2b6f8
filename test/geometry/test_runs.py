"""Numbers of elements in runs, against a loop."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.geometry.runs import in_runs


@given(st.lists(st.integers(0, 5), max_size=12))
def test_each_element_has_its_run_and_its_number(counts: list[int]) -> None:
    run, number = in_runs(np.array(counts, np.int64))
    wanted = [(k, n) for k, count in enumerate(counts) for n in range(count)]
    assert list(zip(run.tolist(), number.tolist(), strict=True)) == wanted
