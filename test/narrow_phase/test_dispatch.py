"""The test that the table names is the one that answers, for every pair of kinds, in both orders."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from shapes import EXAMPLES, SLOT_PAIRS

from collision_monitor.narrow_phase import dispatch
from collision_monitor.narrow_phase.contact_row import CONTACT_SIZE
from collision_monitor.narrow_phase.dispatch import PAIR_TESTS, TEST_METHODS, pair_test
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.work_memory import work_array
from collision_monitor.records import ShapeType
from collision_monitor.shapes.registry import KIND_NAMES, KINDS, kind_of
from collision_monitor.shapes.shape_table import ShapeTableBuilder


def answering(monkeypatch: pytest.MonkeyPatch, kinds: tuple[int, int], ask: str, parallel: bool) -> list[str]:
    """The files of the tests that answer when `contact_within` or `separation` is asked about a pair of shapes."""
    answered: list[str] = []

    def recorder(file: str) -> Callable[..., float]:
        def record(*_: Any) -> float:
            answered.append(file)
            return 1.0

        return record

    for name, value in list(vars(dispatch).items()):
        if hasattr(value, "py_func"):
            file = value.py_func.__module__.rpartition(".")[2]
            monkeypatch.setattr(dispatch, name, recorder(file) if file in TEST_METHODS else value.py_func)
    monkeypatch.setattr(dispatch, "is_parallel", lambda *_: parallel)
    builder = ShapeTableBuilder(slots=2)
    for kind in kinds:
        builder.append(EXAMPLES[ShapeType(kind)])
    pose = PairPose(np.eye(3), np.eye(3), (0.5, 0.0, 0.0))
    limit = (np.inf,) if ask == "contact_within" else ()
    getattr(dispatch, ask)(builder.table, 0, 1, pose, *limit, np.zeros(CONTACT_SIZE), work_array())
    return answered


def test_every_kind_has_an_example() -> None:
    assert [kind.number for kind in KINDS] == sorted(EXAMPLES)
    assert all(kind_of(shape).number == number for number, shape in EXAMPLES.items())


def test_the_table_has_closed_forms_of_pairs_that_can_meet() -> None:
    assert set(PAIR_TESTS) <= {(int(a), int(b)) for a, b in SLOT_PAIRS}
    assert "convex_convex" not in {pair_test(*pair) for pair in PAIR_TESTS}
    assert {pair_test(*pair) for pair in SLOT_PAIRS} == set(TEST_METHODS)


@pytest.mark.parametrize("ask", ["contact_within", "separation"])
@pytest.mark.parametrize("kinds", SLOT_PAIRS, ids=lambda kinds: "-".join(KIND_NAMES[kind] for kind in kinds))
def test_the_test_in_the_table_answers(monkeypatch: pytest.MonkeyPatch, kinds: tuple[int, int], ask: str) -> None:
    slots = [kind_of(EXAMPLES[ShapeType(kind)]).row(EXAMPLES[ShapeType(kind)], None) for kind in kinds]
    file = pair_test(*(slot.number for slot in slots if slot is not None))
    for pair in {kinds, kinds[::-1]}:
        with monkeypatch.context() as patch:
            assert answering(patch, pair, ask, True) == [file]
        with monkeypatch.context() as patch:
            turned = "convex_convex" if file == "cylinder_cylinder" else file
            assert answering(patch, pair, ask, False) == [turned]
