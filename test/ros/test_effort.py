"""When the node reduces its effort, and when it spends it again."""

from __future__ import annotations

import pytest

from collision_monitor.ros.effort import LEVELS, PATIENCE, Effort
from collision_monitor.settings.profile import Profile


def test_the_effort_falls_at_once_and_grows_slowly() -> None:
    effort = Effort()
    chosen = Profile.named("balanced").replace(uncertainty_samples=1024, contact_points=4)
    assert effort.reduced(chosen) is chosen
    assert effort.look(1.0)
    reduced = effort.reduced(chosen)
    assert (reduced.uncertainty_samples, reduced.contact_points) == (256, 1)
    assert reduced.name == "balanced, reduced to 256 samples"
    assert effort.look(1.0)
    assert effort.reduced(chosen).uncertainty_samples == 64
    assert not effort.look(1.0)
    assert effort.level == LEVELS
    assert [effort.look(0.1) for _ in range(PATIENCE)] == [False] * (PATIENCE - 1) + [True]
    assert effort.reduced(chosen) == reduced


def test_a_load_between_the_limits_changes_nothing() -> None:
    effort = Effort()
    effort.look(1.0)
    assert not any(effort.look(load) for load in (0.1, 0.5) * PATIENCE)
    assert effort.level == 1


@pytest.mark.parametrize("samples", [16, 64])
def test_few_samples_are_not_reduced_and_never_increased(samples: int) -> None:
    effort = Effort()
    effort.look(1.0)
    chosen = Profile.named("fast").replace(uncertainty_samples=samples, contact_points=1)
    assert effort.reduced(chosen) is chosen
