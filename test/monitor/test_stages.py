"""Each stage of the step saves and restores all of its own state."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.monitor.state.snapshot import Snapshot, Stage
from collision_monitor.motion.trajectory import Tolerance, Trajectory
from collision_monitor.records import STATE
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Capsule, HalfSpace, Sphere
from collision_monitor.shapes.shape_table import ShapeTableBuilder

STAGES = [type(stage) for stage in Monitor().stages]


@pytest.fixture(scope="module")
def busy() -> Monitor:
    """A monitor in which every stage has state."""
    monitor = Monitor(Profile(pairs_per_step=3, region_min=(-50.0, -50.0, -50.0), region_max=(50.0, 50.0, 50.0)))
    monitor.add(90, HalfSpace((0, 0, 1)), static=True, pose=Pose((0, 0, -2)))
    shapes = [Sphere(0.5), Box((1, 0.6, 0.4)), [(Capsule(0.2, 1.0), Pose()), (Sphere(0.3), Pose((0.5, 0, 0)))]]
    for i in range(80):
        monitor.add(i, shapes[i % 3], name=f"body {i}", allowed=(1,) if i == 0 else (), max_linear_acceleration=i % 2)
    monitor.follow(5, Trajectory([0, 1, 2], [(0, 0, 9), (1, 0, 9), (1, 1, 9)]), tolerance=Tolerance(99, 99, 99, 99))
    rng = np.random.default_rng(3)
    states = np.zeros(80, STATE)
    states["id"], states["quaternion"][:, 3] = np.arange(80), 1.0
    states["position"], states["linear"] = rng.uniform(-6, 6, (80, 3)), rng.uniform(-3, 3, (80, 3))
    states["position"][79] = 100.0
    states["position_stddev"][::4] = 0.05
    for k in range(8):
        monitor.step(k * 20_000_000, states)
        states["position"] += 0.02 * states["linear"]
        states["linear"][k::9] *= -1.0
    monitor.step(900_000_000_000, states)  # refused: the stamp jumps
    touching = monitor.last.contacts["id_a"][0]  # type: ignore[union-attr]
    monitor.remove(int(touching))
    monitor.add(200, Sphere(0.1))
    return monitor


@pytest.mark.parametrize("stage", STAGES, ids=lambda kind: kind.__name__)
def test_each_attribute_is_saved_or_a_cache(stage: type[Stage]) -> None:
    kept = next(each for each in Monitor().stages if type(each) is stage)
    assert not set(stage.SAVED) & set(stage.CACHES)
    assert vars(kept).keys() == {*stage.SAVED, *stage.CACHES}


def test_the_monitor_itself_keeps_its_profile_and_its_stages_alone() -> None:
    monitor = Monitor()
    stages = {id(stage) for stage in monitor.stages}
    others = {name for name, value in vars(monitor).items() if id(value) not in stages}
    assert others == {"_profile", "_settings"}  # arguments of the restored monitor


@pytest.mark.parametrize("stage", STAGES, ids=lambda kind: kind.__name__)
def test_a_snapshot_restores_what_is_saved(stage: type[Stage], busy: Monitor) -> None:
    snapshot = Snapshot.decode(busy.snapshot().encode())
    restored = Monitor.restored(busy.profile, snapshot)
    before, after = (next(s for s in m.stages if type(s) is stage) for m in (busy, restored))
    empty = next(s for s in Monitor().stages if type(s) is stage)
    for name in stage.SAVED:
        assert_same(getattr(before, name), getattr(after, name), busy._roster.top)
    changed = [name for name in stage.SAVED if not is_same(getattr(before, name), getattr(empty, name), 0)]
    assert changed or not stage.SAVED, "the scene exercises the stage"


def is_same(a: Any, b: Any, top: int) -> bool:
    try:
        assert_same(a, b, top)
    except AssertionError:
        return False
    return True


def assert_same(a: Any, b: Any, top: int) -> None:
    """Equal except for the capacity of arrays beyond the `top` bodies and the order in a grid's cells."""
    if isinstance(a, ShapeTableBuilder):
        assert a.free == b.free
        a, b = a.used, b.used
    if isinstance(a, StepResult) and isinstance(b, StepResult):
        assert (a.stamp_ns, a.step, a.status) == (b.stamp_ns, b.step, b.status)
        a, b = (a.contacts, a.predictions), (b.contacts, b.predictions)
    if type(a).__name__ == "HashedGrid":
        names = ("x", "y", "z", "hx", "hy", "hz", "level")
        a, b = ([grid.box[name][grid.box["level"] >= 0] for name in names] for grid in (a, b))
        assert len(a[0]) == len(b[0])
    if isinstance(a, tuple | list) and type(a) is type(b):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same(x, y, top)
    elif isinstance(a, np.ndarray):
        rows = min(len(a), len(b))
        assert a.dtype == b.dtype
        if a.dtype.names:
            for name in a.dtype.names:
                assert_same(a[name], b[name], top)
        else:
            np.testing.assert_array_equal(a[:rows], b[:rows])
            for rest in (a[rows:], b[rows:]):
                assert not rest.size or (rest == rest[-1]).all()
            if top == 0:
                assert len(a) == len(b)
    else:
        assert a == b or (a != a and b != b)
