"""Samples that miss make room for those that may still meet, with all that is known of them."""

import numpy as np
import pytest

from collision_monitor.uncertainty.plane_memory import make_plane_memory
from collision_monitor.uncertainty.samples.live_samples import FEWEST, drop_missed, place_of
from collision_monitor.uncertainty.samples.sample_gaps import FIRST_ORDER, NOT_TURNED, STATE

SAMPLES = 256


@pytest.mark.parametrize("orders", [(FIRST_ORDER, FIRST_ORDER), (NOT_TURNED, FIRST_ORDER), (NOT_TURNED, NOT_TURNED)])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.48, 0.6, 1.0])
def test_live_samples_keep_their_rows_and_order(share: float, orders: tuple[int, int]) -> None:
    rng = np.random.default_rng(int(100 * share))
    memory = make_plane_memory(SAMPLES)
    memory.rows.node[:] = rng.normal(size=memory.rows.node.shape)
    memory.live[:], memory.checked[:] = np.sort(rng.choice(4000, SAMPLES, False)), rng.choice([0.0, np.inf], SAMPLES)
    memory.entry[:] = rng.uniform(size=SAMPLES)
    meets = rng.uniform(size=SAMPLES) < share
    memory.leave[:] = memory.entry + np.where(meets, rng.uniform(size=SAMPLES), -0.1)
    columns = {name: getattr(memory, name).copy() for name in ("entry", "leave", "live", "checked")}
    before, at = memory.rows.node.copy(), 100
    count, moved = drop_missed(SAMPLES, at, orders, memory)
    if 2 * meets.sum() > SAMPLES:
        assert (count, moved) == (SAMPLES, at)
        kept = np.arange(SAMPLES)
    else:
        assert (count, moved) == (meets.sum(), meets[:at].sum())
        kept = np.flatnonzero(meets)
    for name, column in columns.items():
        assert np.array_equal(getattr(memory, name)[:count], column[kept]), name
    used = [r for r in range(STATE) if r < 3 or orders[r // 3 - 1] != NOT_TURNED]
    assert np.array_equal(memory.rows.node[:, used, :count], before[:, used][:, :, kept])
    live = memory.live[:count].tolist()
    for sample in (0, 4000, *columns["live"]):
        assert place_of(int(sample), memory.live, count) == (live.index(sample) if sample in live else -1)


def test_few_samples_stay() -> None:
    memory = make_plane_memory(SAMPLES)
    memory.entry[:] = 1.0
    assert drop_missed(FEWEST, 3, (NOT_TURNED, NOT_TURNED), memory) == (FEWEST, 3)
