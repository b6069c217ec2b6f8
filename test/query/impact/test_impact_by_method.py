"""`time_of_impact` by each classical method: what it certifies, against conservative advancement, and bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor.records import Method

BOX, BALL, STILL = cm.Box((1, 1, 1)), cm.Sphere(0.5), cm.Motion(cm.Pose())
COMING = cm.Motion(cm.Pose((3, 0, 0)), (-1, 0, 0))
METHODS = {
    "closed_form": (BALL, Method.CLOSED_FORM),
    "swept_sat": (BOX, Method.SWEPT_SAT),
    "bisection": (BOX, Method.BISECTION),
    "end_of_step": (BOX, Method.SAMPLING),
}


@pytest.mark.parametrize("method", METHODS)
def test_each_finds_the_head_on_impact(method: str) -> None:
    shape, number = METHODS[method]
    found = cm.time_of_impact(shape, STILL, shape, COMING, 4.0, method=method)
    assert (found.status, found.method) == ("hit", number)
    assert found.lower <= 2.0 <= found.upper + 1e-12
    assert found.upper == pytest.approx(2.0, abs=1 / 60 if method == "end_of_step" else 1e-8)
    assert found.contact is not None


@pytest.mark.parametrize("method", ["closed_form", "swept_sat", "bisection", "end_of_step", "swept_bounds"])
def test_random_pairs_never_contradict_conservative_advancement(method: str) -> None:
    rng = np.random.default_rng(1)
    shape = BALL if method == "closed_form" else BOX
    for _ in range(60):
        q = rng.normal(size=4)
        motions = (
            cm.Motion(cm.Pose(rng.normal(size=3) * 3, q / np.linalg.norm(q)), rng.normal(size=3) * 2) for _ in range(2)
        )
        a, b = motions
        truth = cm.time_of_impact(shape, a, shape, b, 2.0, 1e-10)
        found = cm.time_of_impact(shape, a, shape, b, 2.0, method=method, step=0.02)
        if found.status == "clear":
            assert truth.status != "hit"
        else:
            assert found.lower <= truth.upper + 1e-9
        if found.status == "hit":
            assert truth.lower <= found.upper + 1e-9


def test_sampling_methods_never_call_a_miss_clear() -> None:
    """A bullet passes a plate of 1 mm within one step."""
    plate, bullet = cm.Box((1, 1, 1e-3)), cm.Sphere(5e-4)
    shot = cm.Motion(cm.Pose((0, 0, 3)), (0, 0, -1000.0))
    assert cm.time_of_impact(plate, STILL, bullet, shot).status == "hit"
    for method in ("bisection", "end_of_step"):
        missed = cm.time_of_impact(plate, STILL, bullet, shot, method=method)
        assert (missed.status, missed.upper) == ("unresolved", math.inf)
        assert missed.lower <= 3e-3
        passing = cm.Motion(cm.Pose((9, 0, 3)), (0, 0, -1000.0))
        assert cm.time_of_impact(plate, STILL, bullet, passing, method=method).status == "clear"
        assert cm.time_of_impact(plate, STILL, bullet, shot, 0.01, method=method, step=1e-6).status == "hit"


def test_a_ball_and_the_ground_in_either_order() -> None:
    ground, falling = cm.HalfSpace((0, 0, 1)), cm.Motion(cm.Pose((0, 0, 1.5)), (0, 0, -2.0))
    for pair in ((BALL, falling, ground, STILL), (ground, STILL, BALL, falling)):
        assert cm.time_of_impact(*pair, method="closed_form").upper == pytest.approx(0.5, abs=1e-8)


def test_the_usual_method_names_the_test_that_answered() -> None:
    assert cm.time_of_impact(BALL, STILL, BALL, COMING, 4.0).method is Method.CLOSED_FORM
    assert cm.time_of_impact(BOX, STILL, BOX, COMING, 4.0).method is Method.CONSERVATIVE_ADVANCEMENT


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"method": "magic"}, cm.InputError, "expected one of conservative_advancement, closed_form"),
        ({"method": "bisection", "step": 0.0}, cm.InputError, "step"),
        ({"method": "bisection", "step": 1e-9}, cm.InputError, "step: expected at least"),
        ({"method": "closed_form"}, cm.UnsupportedError, "Sphere with Sphere"),
        ({"method": "bisection", "separation": 0.1}, cm.UnsupportedError, "separation"),
    ],
)
def test_what_is_refused(change: dict[str, object], error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        cm.time_of_impact(BOX, STILL, BOX, COMING, **change)  # type: ignore[arg-type]


def test_methods_refuse_motions_that_they_would_ignore() -> None:
    turning, braking = cm.Motion(cm.Pose(), angular=(0, 0, 1)), cm.Motion(cm.Pose(), acceleration=(1, 0, 0))
    with pytest.raises(cm.UnsupportedError, match="do not turn"):
        cm.time_of_impact(BOX, turning, BOX, COMING, method="swept_sat")
    with pytest.raises(cm.UnsupportedError, match="no acceleration"):
        cm.time_of_impact(BOX, braking, BOX, COMING, method="bisection")
    with pytest.raises(cm.UnsupportedError, match="compounds"):
        cm.time_of_impact([(BOX, cm.Pose((1, 0, 0)))], STILL, BOX, COMING, method="bisection")
