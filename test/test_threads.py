"""Everything public in two threads at once gives the answers that one thread gives, and leaves no trace in a module."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import os
import pkgutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from enum import Enum
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
import pytest
from public_calls import CALLS, ELSEWHERE, answer

import collision_monitor as cm
from collision_monitor import response, world

SEEDS = range(12)
SLOW = ("convex_decomposition", "Session and replay")
"""Calls that take a second and more: two seeds."""

SECONDS = 0.3
"""For which the two threads call one thing again and again, at least once with each seed."""


@pytest.fixture(autouse=True)
def often_switched() -> Iterator[None]:
    """Let Python change between threads every 20 µs."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(2e-5)
    yield
    sys.setswitchinterval(before)


def in_two_threads(run: Callable[[int], None]) -> None:
    """Call run(0) and run(1) at once. Raises what they raise."""
    errors: list[BaseException] = []
    start = threading.Barrier(2)

    def guarded(k: int) -> None:
        start.wait()
        try:
            run(k)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=guarded, args=(k,)) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]


def test_every_public_function_is_called() -> None:
    functions = {name for name in cm.__all__ if isinstance(getattr(cm, name), FunctionType)}
    functions |= {name for name in ("contact", "convex_decomposition") if name in cm.__all__}
    for module in (response, world):
        short = module.__name__.rpartition(".")[2]
        functions |= {f"{short}.{name}" for name in module.__all__ if isinstance(getattr(module, name), FunctionType)}
    assert functions - set(CALLS) - set(ELSEWHERE) == set()


@pytest.mark.parametrize("name", CALLS)
def test_the_answers_in_two_threads_are_those_of_one(name: str) -> None:
    expected = [answer(name, seed) for seed in SEEDS[: 2 if name in SLOW else None]]
    wrong: list[int] = []

    def run(k: int) -> None:
        begun, order = time.monotonic(), np.random.default_rng(k)
        while time.monotonic() - begun < SECONDS:
            seeds = order.permutation(len(expected)).tolist()
            wrong.extend(seed for seed in seeds if answer(name, seed) != expected[seed])

    in_two_threads(run)
    assert not wrong, f"{len(wrong)} answers differ"


def test_different_calls_at_once() -> None:
    quick = [name for name in CALLS if "replay" not in name]
    expected = {(name, seed): answer(name, seed) for name in quick for seed in (0, 1)}
    wrong: list[str] = []

    def run(k: int) -> None:
        order = np.random.default_rng(k)
        for _ in range(2):
            for at in order.permutation(len(quick)).tolist():
                name, seed = quick[at], int(order.integers(2))
                if answer(name, seed) != expected[name, seed]:
                    wrong.append(name)

    in_two_threads(run)
    assert not wrong


FIRST_CALLS = """
import sys, threading
from public_calls import CALLS, answer
sys.setswitchinterval(2e-5)
names, found = list(CALLS), [{}, {}]
start = threading.Barrier(2)
def run(k):
    start.wait()
    for name in names if k == 0 else names[::-1]:
        found[k][name] = answer(name, 3)
threads = [threading.Thread(target=run, args=(k,)) for k in range(2)]
for thread in threads: thread.start()
for thread in threads: thread.join()
later = {name: answer(name, 3) for name in names}
print([name for name in names if not found[0].get(name) == found[1].get(name) == later[name]])
"""


def test_the_first_calls_may_be_those_of_two_threads() -> None:
    """Kernels are loaded and caches are filled by both."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST_CALLS],
        cwd=Path(__file__).parent / "helpers",
        capture_output=True,
        text=True,
        timeout=600.0,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip() == "[]", done.stdout


# -- what modules hold

CHANGE: dict[str, str] = {
    "_jit.compilation.Announcement.is_made": "a notice that is given once",
}
"""Data of modules that calls change, with the reason why threads may share it."""

OWN = {
    "query.contact.contact_kernel.QueryMemory": "threading.local",
    "query.impact.impact_kernel.ImpactMemory": "threading.local",
    "query.library.Library": "slots of shapes, given and freed under a lock; a kernel reads the arrays of its call",
    "geometry.bounded_cache.BoundedCache": "remembers answers of pure functions, under a lock",
}
"""Classes of objects in modules that hold what changes, with the reason why threads may share them."""

FROZEN = ("_jit.function.Function", "_jit.settled.SettledFunction", "shapes.")
"""Beginnings of the names of further classes whose objects no call changes: kernels, which are loaded once, and shapes,
whose trees are made once; what two threads make at the same time is equal."""


def is_frozen(own: type) -> bool:
    frozen = dataclasses.is_dataclass(own) and own.__dataclass_params__.frozen  # type: ignore[attr-defined]
    return frozen or issubclass(own, tuple | Enum)


def modules() -> list[ModuleType]:
    found = []
    for each in pkgutil.walk_packages(cm.__path__, "collision_monitor."):
        if each.name.startswith(("collision_monitor.__main__", "collision_monitor.ros", "collision_monitor.view")):
            continue
        with contextlib.suppress(ModuleNotFoundError):  # an optional package
            found.append(importlib.import_module(each.name))
    return found


def data_of(value: Any) -> Any:
    """What a call could change of a value in a module: the content of arrays and containers."""
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, dict):
        return [(str(key), data_of(each)) for key, each in value.items()]
    if isinstance(value, list | tuple):
        return [data_of(each) for each in value]
    if isinstance(value, set):
        return sorted(map(str, value))
    return None


def held(found: list[ModuleType]) -> dict[str, Any]:
    values = {}
    for module in found:
        for name, value in vars(module).items():
            if not name.startswith("__") and isinstance(value, np.ndarray | dict | list | tuple | set):
                values[f"{module.__name__.removeprefix('collision_monitor.')}.{name}"] = data_of(value)
    return values


def test_no_call_changes_data_of_a_module() -> None:
    found = modules()
    for name in CALLS:
        answer(name, 0)  # what is imported and loaded at first calls
    before = held(found)
    for name in CALLS:
        answer(name, 1)
    after = held(found)
    changed = [name for name, value in before.items() if value != after[name]]
    assert [name for name in changed if name not in CHANGE] == []


def test_every_object_in_a_module_is_immutable_or_has_a_reason() -> None:
    strange = set()
    for module in modules():
        for name, value in vars(module).items():
            own = type(value)
            home = f"{own.__module__}.{own.__qualname__}".removeprefix("collision_monitor.")
            if name.startswith("__") or not own.__module__.startswith("collision_monitor"):
                continue
            if not (is_frozen(own) or home in OWN or home.startswith(FROZEN)):
                strange.add(f"{module.__name__}.{name}: {home}")
    assert strange == set()
