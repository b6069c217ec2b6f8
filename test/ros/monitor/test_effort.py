"""What the node does to keep up, in which order, and when it stops doing so."""

from __future__ import annotations

import pytest

from collision_monitor.ros.monitor.effort import LEVELS, MOST_THREADS, PATIENCE, Effort
from collision_monitor.settings.profile import MOST_NAME, Profile


def test_the_effort_falls_at_once_and_grows_slowly() -> None:
    effort = Effort(cores=1)
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


@pytest.mark.parametrize(("cores", "threads"), [(2, 2), (4, 4), (64, MOST_THREADS)])
def test_threads_that_change_no_answer_come_first(cores: int, threads: int) -> None:
    effort, chosen = Effort(cores), Profile.named("balanced")
    effort.look(1.0)
    faster = effort.reduced(chosen)
    assert faster == chosen.replace(name=f"balanced, on {threads} threads", threads=threads)
    names = []
    while effort.look(1.0):
        names.append(effort.reduced(chosen).name)
    assert names == [f"{faster.name}, reduced to {samples} samples" for samples in (256, 64)]


def test_long_steps_need_more_than_threads() -> None:
    effort, chosen = Effort(cores=2), Profile.named("balanced")
    effort.look(1.0, step=0.6)
    assert effort.reduced(chosen).name == "balanced, on 2 threads, reduced to 256 samples"
    effort.look(1.0, step=0.6)
    assert effort.reduced(chosen).name == "balanced, on 2 threads, reduced to 64 samples"


def test_the_longest_name_can_be_extended() -> None:
    effort = Effort(cores=2)
    effort.look(1.0, step=0.6)
    name = effort.reduced(Profile(name="n" * MOST_NAME)).name
    assert name.endswith("n, on 2 threads, reduced to 256 samples")


def test_a_profile_with_more_threads_keeps_them() -> None:
    effort, chosen = Effort(cores=2), Profile.named("balanced").replace(threads=8)
    effort.look(1.0)
    assert effort.reduced(chosen).threads == 8
    assert effort.reduced(chosen).name == "balanced, reduced to 256 samples"


def test_a_load_between_the_limits_changes_nothing() -> None:
    effort = Effort()
    effort.look(1.0)
    assert not any(effort.look(load) for load in (0.1, 0.5) * PATIENCE)
    assert effort.level == 1


def test_states_that_were_left_out_count_with_the_load() -> None:
    effort = Effort()
    assert not effort.look(0.85)
    assert not effort.look(0.5, is_behind=True)  # one slow step
    assert effort.look(0.85, is_behind=True)


@pytest.mark.parametrize("samples", [16, 64])
def test_few_samples_are_not_reduced_and_never_increased(samples: int) -> None:
    effort = Effort(cores=1)
    effort.look(1.0)
    chosen = Profile.named("fast").replace(uncertainty_samples=samples, contact_points=1)
    assert effort.reduced(chosen) is chosen
