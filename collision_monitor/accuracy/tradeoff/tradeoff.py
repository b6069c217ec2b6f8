"""Trade-off of time and errors on several inputs: each through profiles, or through models of its shapes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace

from collision_monitor.accuracy.inputs import Workload
from collision_monitor.accuracy.tradeoff.default_scenes import MESH_SCENE
from collision_monitor.accuracy.tradeoff.measurement import Measurement
from collision_monitor.accuracy.tradeoff.model_tradeoff import COMPARED_STEPS, MODELS, model_tradeoff
from collision_monitor.accuracy.tradeoff.profile_tradeoff import profile_tradeoff
from collision_monitor.accuracy.tuning.front import fixed_part
from collision_monitor.settings.profile import Profile

ProgressBar = Callable[[str, int], AbstractContextManager[Callable[[int], None]]]
"""Opens a bar with a name and a total number of steps. Yields a function of the number of steps just done."""


def tradeoff(
    inputs: Iterable[Workload],
    profiles: Sequence[Profile] | None,
    models: Sequence[str] | None,
    progress_bar: ProgressBar,
) -> list[Measurement]:
    """Return the rows of each input: of the models or the profiles that are named. Raises InputError.

    Without either: of all profiles, the fastest first, and for MESH_SCENE of MODELS.
    """
    named = profiles or sorted(map(Profile.named, Profile.names()), key=lambda each: -each.position_tolerance)
    rows = []
    for work in inputs:
        name, descriptions, steps = work.name, work.descriptions, work.steps
        if models or (name == MESH_SCENE and not profiles):
            chosen = models or MODELS
            with progress_bar(name, len(chosen) * len(steps) + min(COMPARED_STEPS, len(steps))) as progress:
                found = model_tradeoff(name, descriptions, steps, chosen, progress)
        else:
            with progress_bar(name, 2 * len(steps) * len(named)) as progress:
                found = profile_tradeoff(name, descriptions, steps, named, progress)
            fixed = fixed_part(work)
            found = [replace(row, fixed_us=fixed) for row in found]
        rows += [replace(row, noise=work.noise) for row in found]
    return rows
