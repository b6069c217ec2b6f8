"""Steady levels against a state machine that looks at one pair and its whole past."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.alerts.debounce import ENTRY, Conditions, Delays, advance_entries, lasting, restart

MS = 1_000_000
KEY = np.uint64(5 << 32 | 9)


def reference(levels: list[int], doubts: list[bool], times: list[int], raise_after: int, clear_after: int) -> list[int]:
    """Level after each step, from the history of the conditions."""
    shown = [0]
    for n, now in enumerate(times):
        level = 0
        for k in (1, 2, 3):
            met = levels[n] >= k
            begin = n
            while begin > 0 and levels[begin - 1] >= k:
                begin -= 1
            rises = met and now - times[begin] >= raise_after
            up = shown[n] >= k
            held = [t for m, t in enumerate(times[:n]) if levels[m] >= k or (doubts[m] and shown[m] >= k)]
            last = max(held, default=None)
            stays = up and (met or doubts[n] or (last is not None and now - last < clear_after))
            if rises or stays:
                level = k
        shown.append(level)
    return shown[1:]


@given(
    st.lists(st.tuples(st.integers(0, 3), st.booleans(), st.sampled_from([0, 10, 40, 100])), min_size=1, max_size=25),
    st.sampled_from([0, 30, 100]),
    st.sampled_from([0, 50, 200]),
)
def test_levels_against_the_whole_past(steps: list[tuple[int, bool, int]], up: int, down: int) -> None:
    levels, doubts = [s[0] for s in steps], [s[1] for s in steps]
    times = np.cumsum([s[2] * MS for s in steps]).tolist()
    entries, found = np.zeros(0, ENTRY), []
    for level, doubt, now in zip(levels, doubts, times, strict=True):
        keys = np.array([KEY])
        conditions = Conditions(keys, np.array([level], np.uint8), keys if doubt else keys[:0])
        rows, before = advance_entries(entries, conditions, now, Delays(up * MS, down * MS))
        found.append(int(rows["level"][0]) if len(rows) else 0)
        assert (int(before[0]) if len(before) else 0) == ([0, *found][-2])
        entries = lasting(rows)
    assert found == reference(levels, doubts, times, up * MS, down * MS)


def test_pairs_do_not_affect_each_other() -> None:
    generator = np.random.default_rng(1)
    keys = np.sort(generator.choice(1 << 40, 50, replace=False).astype(np.uint64))
    delays = Delays(60 * MS, 120 * MS)
    together, alone = np.zeros(0, ENTRY), {key: np.zeros(0, ENTRY) for key in keys.tolist()}
    for step in range(40):
        here = np.sort(generator.choice(keys, 30, replace=False))
        level = generator.integers(0, 4, 30).astype(np.uint8)
        doubt = here[generator.random(30) < 0.2]
        together = lasting(advance_entries(together, Conditions(here, level, doubt), step * 30 * MS, delays)[0])
        for key in keys:
            mine = here == key
            conditions = Conditions(here[mine], level[mine], doubt[doubt == key])
            alone[int(key)] = lasting(advance_entries(alone[int(key)], conditions, step * 30 * MS, delays)[0])
        np.testing.assert_array_equal(together, np.concatenate([alone[int(key)] for key in keys]))
    assert len(together)


def test_a_restart_of_the_time_keeps_the_levels() -> None:
    keys, delays = np.array([KEY]), Delays(0, 100 * MS)
    entries, _ = advance_entries(
        np.zeros(0, ENTRY), Conditions(keys, np.array([2], np.uint8), keys[:0]), 10**12, delays
    )
    restart(entries, 0)
    nothing = Conditions(keys[:0], np.zeros(0, np.uint8), keys[:0])
    rows, _ = advance_entries(entries, nothing, 99 * MS, delays)
    assert rows["level"].tolist() == [2]
    rows, before = advance_entries(rows, nothing, 100 * MS, delays)
    assert (rows["level"].tolist(), before.tolist()) == ([0], [2])
