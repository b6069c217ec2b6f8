"""Tests of the extremes: the exact answers are correct, all bounds hold, and a wrong answer is detected."""

from __future__ import annotations

import copy
import json
import subprocess
import sys
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from collision_monitor import Box, Capsule, Contact, Motion, Pose, Sphere, contact, time_of_impact
from collision_monitor.accuracy import exact, exact_comparison, extremes

PROGRAM = Path(sys.executable).with_name("collision-monitor")
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def test_exact_answers_that_are_known() -> None:
    assert exact.exact_sphere_sphere((0, 0, 0), (3, 4, 0), 1.0, 1.5) == Decimal("2.5")
    quarter = (0.0, 0.0, 1.0, 1.0)  # a quaternion of any length
    assert exact.sphere_box((3, 0, 0), 0.5, (0, 0, 0), quarter, (2, 4, 2)) == Decimal("0.5")
    assert exact.sphere_box((0, 0, 0.75), 0.5, (0, 0, 0), UPRIGHT, (2, 4, 2)) == Decimal("-0.75")
    apart = exact.capsule_capsule((0, 0, 0), UPRIGHT, 0.5, 2.0, (3, 0, 5), UPRIGHT, 0.5, 2.0)
    assert abs(apart - (Decimal(18).sqrt() - 1)) < Decimal("1e-25")
    assert exact.box_box_depth((0, 0, 0), UPRIGHT, (2, 2, 2), (1.75, 0, 0), UPRIGHT, (2, 2, 2)) == Decimal("-0.25")
    assert exact.box_box_depth((0, 0, 0), UPRIGHT, (2, 2, 2), (3, 0, 0), UPRIGHT, (2, 2, 2)) is None
    assert exact.spheres_meet((4, 0, 0), (-1, 0, 0), (1.0, 0.5)) == Decimal("2.5")
    assert exact.spheres_meet((4, 0, 0), (1, 0, 0), (1.0, 0.5)) is None
    assert exact.aligned_boxes_meet((4, 1, 0), (-2, 0, 0), (1, 1, 1), (1, 2, 1)) == Decimal("1.5")
    assert exact.aligned_boxes_meet((4, 1.6, 0), (-2, 0, 0), (1, 1, 1), (1, 2, 1)) is None


def test_a_rotation_is_one_in_all_digits() -> None:
    a, b, c = exact.exactly(exact.axes)((0.1, -0.7, 0.3, 0.5))
    dot = exact.exactly(exact.exact_dot)
    assert abs(dot(a, a) - 1) < Decimal("1e-57")
    assert abs(dot(a, b)) < Decimal("1e-57")
    assert max(abs(x - y) for x, y in zip(exact.exactly(exact.exact_cross)(a, b), c, strict=True)) < Decimal("1e-57")


def test_every_truth_is_within_its_bound() -> None:
    done = []
    rows = extremes.run(samples=2, progress=done.append)
    assert sum(done) == extremes.steps()
    assert {row.sweep for row in rows} == {*extremes.SWEEPS, "stamp"}
    assert [f"{row.sweep}, {row.quantity}: {row.ratio}" for row in rows if not row.holds] == []
    assert all(
        row.error < 1e-15 for row in rows if row.sweep in ("size", "from the origin") and "meet" not in row.quantity
    )


def _changed(answer: Contact, distance: float) -> Contact:
    made = copy.copy(answer)
    made.__dict__["signed_distance"] = distance
    return made


def test_a_wrong_answer_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def off(*arguments):
        answer = contact(*arguments)
        return _changed(answer, answer.signed_distance * (1 + 1e-12))

    monkeypatch.setattr(exact_comparison, "contact", off)
    rows = {(row.sweep, row.quantity): row for row in extremes.run(samples=1)}
    assert not rows["size", "sphere–sphere"].holds
    assert rows["size", "spheres meet"].holds


def test_nearly_parallel_capsules_state_how_far_off_they_may_be() -> None:
    """At 1e-10 rad the cores count as parallel. The answer uses their middle, and an end is nearer by up to 1e-10."""
    worst = 0.0
    rng = np.random.default_rng(3)
    for _ in range(200):
        half = 10.0 ** rng.uniform(-11, -9) / 2
        place = Pose(
            (rng.uniform(0.5, 1.0), rng.uniform(-1, 1), rng.uniform(-1, 1)), (0, np.sin(half), 0, np.cos(half))
        )
        answer = contact(Capsule(0.1, 2.0), Pose(), Capsule(0.1, 2.0), place)
        truth = exact.capsule_capsule((0, 0, 0), UPRIGHT, 0.1, 2.0, place.position, place.quaternion, 0.1, 2.0)
        worst = max(worst, float(abs(Decimal(answer.signed_distance) - truth)) / answer.error_bound)
    assert worst <= 1.0


@pytest.mark.parametrize("gap", [1e-15, 1e-12, 1e-9])
@pytest.mark.parametrize("scale", [1e-140, 1e-9, 1.0, 1e9])
def test_the_time_of_a_tiny_gap_is_within_its_interval(gap: float, scale: float) -> None:
    """The difference of the squares loses digits of the gap. Both ends of the interval must include this error."""
    rng = np.random.default_rng(4)
    for _ in range(50):
        r, s = rng.uniform(0.3, 1.0, 2) * scale
        away = rng.normal(size=3)
        p = (r + s) * (1 + gap) * away / np.linalg.norm(away)
        v = -p
        answer = time_of_impact(Sphere(r), Motion(Pose()), Sphere(s), Motion(Pose(p), v), 2.0, 1e-9 * scale)
        truth = exact.spheres_meet(p, v, (r, s))
        assert Decimal(answer.lower) <= truth
        assert Decimal(answer.upper) >= truth


def test_boxes_of_very_different_size_are_in_contact_at_the_upper_time() -> None:
    rng = np.random.default_rng(5)
    for _ in range(30):
        size_a, size_b = rng.uniform(0.5, 1.0, 3), 1e12 * rng.uniform(0.5, 1.0, 3)
        p, v = np.array([(size_a[0] + size_b[0]) / 2 + 0.5, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])
        answer = time_of_impact(Box(size_a), Motion(Pose()), Box(size_b), Motion(Pose(p), v), 2.0, 1e-9)
        truth = exact.aligned_boxes_meet(p, v, size_a, size_b)
        assert Decimal(answer.lower) <= truth <= Decimal(answer.upper)


def test_the_command(tmp_path: Path) -> None:
    command = [PROGRAM, "extremes", "--samples", "1", "--json", "--png", str(tmp_path / "e.png")]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert answer.returncode == 0, answer.stderr
    rows = json.loads(answer.stdout)["rows"]
    assert len(rows) == 61 and all(row["holds"] for row in rows)
    assert (tmp_path / "e.png").read_bytes().startswith(b"\x89PNG")
