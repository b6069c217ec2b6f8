"""`cm.impacts`: entries and exits against closed forms and dense samples."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
import pytest
from contact_intervals import SHAPES, check_intervals

import collision_monitor as cm
from collision_monitor import Motion, Pose, impacts
from collision_monitor.errors import InputError


def test_a_ball_that_passes_another_one() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        beside, speed = rng.uniform(0.0, 0.9), rng.uniform(0.5, 20.0)
        (found,) = impacts(
            cm.Sphere(0.6), Motion(Pose((-3, beside, 0)), (speed, 0, 0)), cm.Sphere(0.4), Motion(Pose()), 6.0 / speed
        )
        half = sqrt(1.0 - beside**2)
        enters, leaves = (3.0 - half) / speed, (3.0 + half) / speed
        assert found.entry[0] <= enters + 1e-9 and found.entry[1] >= enters - 1e-9
        assert found.exit[0] <= leaves + 1e-9 and found.exit[1] >= leaves - 1e-9
        assert found.entry[1] - found.entry[0] < 1e-5 / speed / half
        assert found.exit[1] - found.exit[0] < 2e-5 / speed / half


def test_a_propeller_meets_a_post_with_each_blade() -> None:
    blade, rate = cm.Box((3.0, 0.1, 0.1)), 2.0 * np.pi
    found = impacts(blade, Motion(Pose(), (0, 0, 0), (0, 0, rate)), cm.Sphere(0.1), Motion(Pose((0, 1.2, 0))), 2.0)
    assert len(found) == 4
    middles = [0.5 * (each.entry[1] + each.exit[0]) for each in found]
    assert middles == pytest.approx([0.25, 0.75, 1.25, 1.75], abs=1e-6)


@pytest.mark.parametrize("kinds", list(zip(SHAPES, [*list(SHAPES)[2:], *list(SHAPES)[:2]], strict=True)), ids="-".join)
def test_dense_samples_find_the_same_intervals(kinds: tuple[str, str]) -> None:
    rng = np.random.default_rng(sum(map(ord, "".join(kinds))))
    a, b = SHAPES[kinds[0]], SHAPES[kinds[1]]
    several = 0
    for _ in range(12):
        one = Motion(Pose(), rng.normal(size=3) * 0.3, rng.normal(size=3) * 4.0, frame="body")
        other = Motion(Pose(rng.normal(size=3) * 0.5), rng.normal(size=3) * 0.5, rng.normal(size=3))
        found = impacts(a, one, b, other, 3.0)
        several += len(found) > 1
        check_intervals(found, a, one, b, other, 3.0, 301)
    assert several > 0


def test_contact_that_lasts_ends_at_the_horizon() -> None:
    (found,) = impacts(cm.Box((1, 1, 1)), Motion(Pose()), cm.Box((1, 1, 1)), Motion(Pose((0.5, 0, 0))), 2.0)
    assert found.entry == (0.0, 0.0) and found.exit == (2.0, inf)


def test_a_body_that_stops_in_another_one_stays_there() -> None:
    brakes = Motion(Pose(), (2, 0, 0), (0, 0, 0), (-1, 0, 0), stops=True)
    (found,) = impacts(cm.Sphere(0.5), brakes, cm.Sphere(0.5), Motion(Pose((2.5, 0, 0))), 8.0)
    assert found.entry[1] == pytest.approx(1.0, abs=1e-5) and found.exit == (8.0, inf)


def test_clear_is_no_interval_and_most_bounds_their_number() -> None:
    away = Motion(Pose((5, 0, 0)), (1, 0, 0))
    assert impacts(cm.Sphere(1), Motion(Pose()), cm.Sphere(1), away) == []
    spins = Motion(Pose(), (0, 0, 0), (0, 0, 50))
    found = impacts(cm.Box((3.0, 0.1, 0.1)), spins, cm.Sphere(0.1), Motion(Pose((0, 1.2, 0))), 2.0, most=5)
    assert len(found) == 5
    with pytest.raises(InputError):
        impacts(cm.Sphere(1), Motion(Pose()), cm.Sphere(1), away, most=0)
