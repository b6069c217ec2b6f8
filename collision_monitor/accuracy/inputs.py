"""Inputs of the measurements: steps of simulated scenes, recorded tracks and recorded sessions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from collision_monitor.accuracy.playback import Step
from collision_monitor.accuracy.tradeoff.default_scenes import (
    DEFAULT_DURATION,
    DEFAULT_SCENES,
    STATE_NOISE,
    TRACK_SCENE,
)
from collision_monitor.codec import decode_descriptions, decode_states
from collision_monitor.errors import InputError, MessageError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.session import Session
from collision_monitor.world import check_path, make_scene
from collision_monitor.world.recorded_tracks import clip_paths


class Workload(NamedTuple):
    """A scene or session: its name, objects, steps, and the noise of its states (see `world.measured`).

    damage: one sentence for each part of a session that is missing or broken.
    """

    name: str
    descriptions: list[ObjectDescription]
    steps: list[Step]
    noise: float = 0.0
    damage: tuple[str, ...] = ()


def recorded(path: Path) -> Workload:
    """Read a session. All objects exist from the first step on, with their last description.

    Malformed messages are skipped. Raises SessionError; InputError if the session has no objects or no states.
    """
    described: dict[int, ObjectDescription] = {}
    steps = []
    session = Session(path)
    for message in session.messages():
        with suppress(MessageError):
            if message.type == "ObjectDescriptionArray":
                changes = decode_descriptions(message.data).objects
                described.update({it.object_id: it for it in changes if isinstance(it, ObjectDescription)})
            elif message.type == "ObjectStateArray":
                states = decode_states(message.data)
                steps.append((states.stamp_ns, states.states.copy()))
    if not described or not steps:
        raise InputError(f"{path}: expected object shapes and states, found {len(described)} and {len(steps)} of them")
    return Workload(path.stem, list(described.values()), steps, damage=tuple(session.damage))


def simulated(
    scenes: Sequence[str] | None = None,
    *,
    objects: int | None = None,
    seed: int = 1,
    path: Path | None = None,
    noise: float | None = None,
    duration: float | None = None,
) -> Iterator[Workload]:
    """Yield each scene from its start. Each clip of recorded tracks is a scene. None: see `default_scenes`.

    duration: s, of each scene (None: DEFAULT_DURATION, or the whole clip). Raises InputError, see `make_scene`.
    """
    if scenes and TRACK_SCENE not in scenes:
        check_path(scenes[0], path)
    for name, scene_noise in _scenes(scenes, path, noise):
        for clip in clip_paths(path) if name == TRACK_SCENE and path else [None]:
            scene = make_scene(name, objects=objects, seed=seed, path=clip, noise=scene_noise)
            seconds = DEFAULT_DURATION if scene.duration is None else scene.duration + 1.0 / scene.rate
            count = max(round((duration or seconds) * scene.rate), 1)
            steps = [(0, scene.states())]
            while len(steps) < count and not scene.finished:
                states = scene.step()
                steps.append((round(scene.time * 1e9), states))
            yield Workload(clip.stem if clip and name == TRACK_SCENE else name, scene.descriptions, steps, scene_noise)


def _scenes(names: Sequence[str] | None, path: Path | None, noise: float | None) -> list[tuple[str, float]]:
    """Return the names of the scenes with the noise of their states."""
    chosen = names or [*DEFAULT_SCENES, *([TRACK_SCENE] if path else [])]
    if noise is not None:
        return [(name, noise) for name in chosen]
    usual = [(name, STATE_NOISE.get(name, 0.0)) for name in chosen]
    return usual if names else [*((name, 0.0) for name in STATE_NOISE), *usual]
