"""Measure the work that the scene plan skips: each item forced on, with the same states.

    python benchmarks/scene_plan.py                  # 300 objects for each item
    python benchmarks/scene_plan.py --objects 1000 --steps 200

Both monitors get the same scene. Additional answers of the second one are about pairs that are not requested; the other
answers are the same (test/monitor/test_scene_plan.py).
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.monitor.monitor import Monitor
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.registry import Box, Circle, Mesh, Sphere
from collision_monitor.world import make_scene
from collision_monitor.world.scene import state_array

POINT: Final = (1e-9, 1e-9, 1e-9)
"""Size of a box that represents a point (m)."""

States = NDArray[np.void]
Rows = NDArray[np.void]


def _all(rows: Rows, _states: States) -> NDArray[np.bool_]:
    return np.ones(len(rows), bool)


def _same(states: States) -> States:
    return states


class Item(NamedTuple):
    """Two monitors and their states. off: with the plan; on: with the item forced on.

    states_on: turns the states of `off` into those of `on`. asked_for: mask of the rows of `on` that `off` has too.
    """

    off: Monitor
    on: Monitor
    states: Iterator[tuple[int, States]]
    states_on: Callable[[States], States] = _same
    asked_for: Callable[[Rows, States], NDArray[np.bool_]] = _all


def _monitor(descriptions: list[ObjectDescription], profile: Profile | None = None) -> Monitor:
    monitor = Monitor(profile or Profile())
    for description in descriptions:
        monitor.describe(description)
    return monitor


def _played(scene: Any) -> Iterator[tuple[int, States]]:
    while True:
        yield round(scene.time * 1e9), scene.states()
        scene.step()


def rotation(objects: int) -> Item:
    """Spheres, forced on: predicted like bodies whose rotation matters."""
    scene = make_scene("particles", objects=objects)
    item = Item(_monitor(scene.descriptions), _monitor(scene.descriptions), _played(scene))
    bodies = item.on._roster.bodies
    bodies.spin_radius[: item.on._roster.top] = bodies.motion["radius"][: item.on._roster.top]
    return item


def space(objects: int) -> Item:
    """Discs in a plane, forced on: spheres in space."""
    scene = make_scene("clutter", objects=objects)
    ids = [d.object_id for d in scene.descriptions]
    random = np.random.default_rng(1)
    radii = random.uniform(0.1, 0.4, len(ids)).tolist()
    scene.position[:, :2] *= np.sqrt(objects / scene.size**2)  # type: ignore[attr-defined]
    scene.size = np.sqrt(objects)  # type: ignore[attr-defined]

    def flat() -> Iterator[tuple[int, States]]:
        for stamp, states in _played(scene):
            for name in ("position", "linear"):
                states[name][:, 2] = 0.0
            states["quaternion"], states["angular"] = (0, 0, 0, 1), 0.0
            yield stamp, states

    discs = [ObjectDescription(i, Circle(radius)) for i, radius in zip(ids, radii, strict=True)]
    balls = [ObjectDescription(i, Sphere(radius)) for i, radius in zip(ids, radii, strict=True)]
    return Item(_monitor(discs), _monitor(balls), flat())


def uncertainty(objects: int) -> Item:
    """Certain states, forced on: every state declares a standard deviation of a nanometre."""
    scene = make_scene("clutter", objects=objects)

    def declared(states: States) -> States:
        states = states.copy()
        states["position_stddev"] = 1e-9
        return states

    return Item(_monitor(scene.descriptions), _monitor(scene.descriptions), _played(scene), declared)


def static_pairs(objects: int) -> Item:
    """Static objects, forced on: described as moving with zero speed, so that pairs of them are visited."""
    scene = make_scene("fleet", objects=objects)
    static = [d for d in scene.descriptions if d.static]
    moving = [replace(d, static=False, pose=None) if d.static else d for d in scene.descriptions]
    standing = state_array(np.array([d.object_id for d in static], np.uint32))
    standing["position"] = [d.pose.position for d in static if d.pose is not None]
    standing["quaternion"] = [d.pose.quaternion for d in static if d.pose is not None]

    def with_standing(states: States) -> States:
        return np.concatenate([states, standing])

    def not_both(rows: Rows, _states: States) -> NDArray[np.bool_]:
        return ~(np.isin(rows["id_a"], standing["id"]) & np.isin(rows["id_b"], standing["id"]))

    return Item(_monitor(scene.descriptions), _monitor(moving), _played(scene), with_standing, not_both)


def groups(objects: int) -> Item:
    """Four groups that never meet, forced on: all objects in one group."""
    scene = make_scene("clutter", objects=objects)
    bits = [1 << (d.object_id % 4) for d in scene.descriptions]
    apart = [replace(d, group=bit, mask=bit) for d, bit in zip(scene.descriptions, bits, strict=True)]

    def alike(rows: Rows, _states: States) -> NDArray[np.bool_]:
        return np.asarray(rows["id_a"] % 4 == rows["id_b"] % 4)

    return Item(_monitor(apart), _monitor(scene.descriptions), _played(scene), _same, alike)


def region(objects: int) -> Item:
    """A region of an eighth of the volume, forced on: no region."""
    scene = make_scene("clutter", objects=objects)
    high = 0.5 * float(scene.size)  # type: ignore[attr-defined]
    inside = Profile(region_min=(-9.0, -9.0, -9.0), region_max=(high, high, high))
    off, on = _monitor(scene.descriptions, inside), _monitor(scene.descriptions)
    radius = off._roster.bodies.motion["radius"][:objects]

    def both_inside(rows: Rows, states: States) -> NDArray[np.bool_]:
        nearest = np.clip(states["position"], -9.0, high)
        ids = states["id"][np.linalg.norm(states["position"] - nearest, axis=1) <= radius]
        return np.isin(rows["id_a"], ids) & np.isin(rows["id_b"], ids)

    return Item(off, on, _played(scene), _same, both_inside)


def sat(objects: int) -> Item:
    """Spheres, forced on: boxes of a nanometre grown by the radius, so that SAT tests the axes of each pair."""
    scene = make_scene("clutter", objects=objects)
    radii = np.random.default_rng(1).uniform(0.1, 0.4, objects).tolist()
    ids = [d.object_id for d in scene.descriptions]
    balls = [ObjectDescription(i, Sphere(radius)) for i, radius in zip(ids, radii, strict=True)]
    boxes = [ObjectDescription(i, Box(POINT), padding=radius) for i, radius in zip(ids, radii, strict=True)]
    return Item(_monitor(balls), _monitor(boxes), _played(scene))


def meshes(objects: int) -> Item:
    """Boxes, forced on: closed meshes of twelve triangles."""
    scene = make_scene("clutter", objects=objects)
    sizes = np.random.default_rng(1).uniform(0.2, 0.8, (objects, 3))
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6),
             (0, 6, 4), (1, 5, 7), (1, 7, 3)]  # fmt: skip
    ids = [d.object_id for d in scene.descriptions]
    boxes = [ObjectDescription(i, Box(tuple(size))) for i, size in zip(ids, sizes.tolist(), strict=True)]
    soups = [ObjectDescription(i, Mesh(size * corners, faces)) for i, size in zip(ids, sizes, strict=True)]
    return Item(_monitor(boxes), _monitor(soups), _played(scene))


ITEMS: Final[dict[str, Callable[[int], Item]]] = {
    "rotation": rotation,
    "3-D": space,
    "SAT": sat,
    "meshes": meshes,
    "uncertainty": uncertainty,
    "static pairs": static_pairs,
    "groups that never meet": groups,
    "objects outside the region": region,
}


def main() -> None:
    """Measure and print a line for each item."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=300)
    parser.add_argument("--steps", type=int, default=150)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    rows = []
    for name, make in ITEMS.items():
        item = make(args.objects)
        spent: tuple[list[float], list[float]] = ([], [])
        for _, (stamp, states) in zip(range(args.steps), item.states, strict=False):
            for monitor, given, times in ((item.off, states, spent[0]), (item.on, item.states_on(states), spent[1])):
                began = time.thread_time()
                monitor.step(stamp, given)
                times.append(1e3 * (time.thread_time() - began))
        off, on = (float(np.mean(each[10:])) for each in spent)
        rows.append({"item": name, "off_ms": off, "on_ms": on, "times": on / off})
        if not args.json:
            print(f"{name:28} skipped {off:7.3f} ms   forced on {on:7.3f} ms   {on / off:5.2f} times", flush=True)
    if args.json:
        print(json.dumps({"objects": args.objects, "load": os.getloadavg()[0], "rows": rows}))


if __name__ == "__main__":
    main()
