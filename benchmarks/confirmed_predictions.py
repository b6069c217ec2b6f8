"""Compare the monitor's predictions for the scene "hard_spheres" with the collisions that the simulation then has.

A certain prediction can only fail to happen if one of the two bodies collides with a third before. All others have to
happen within their interval. The next collision of all has to be predicted, certain or unresolved, and so has each
collision within the horizon of two bodies that fly straight until then.

    python benchmarks/confirmed_predictions.py --objects 200 --duration 30               # in this process
    collision-monitor demo --scene hard_spheres --objects 100 --output spheres.mcap      # through the node,
    python benchmarks/confirmed_predictions.py --objects 100 --session spheres.mcap      # then compare its recording
"""

from __future__ import annotations

import argparse
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from collision_monitor.world import make_scene
from collision_monitor.world.hard_spheres.hard_spheres_scene import HardSpheresScene

ROUND_OFF = 1e-9
"""s: stamps are whole nanoseconds."""
HORIZON = 2.0
"""s: look-ahead of the profile `balanced`."""
HIT, UNRESOLVED = 0, 1
Predictions = tuple[float, NDArray[np.void]]
"""Time of a step (s) and its predictions."""


@dataclass
class Confirmation:
    """Counts of predictions and of collisions."""

    predictions: int = 0
    happened: int = 0
    prevented: int = 0
    wrong: int = 0
    unresolved: int = 0
    first: int = 0
    first_happened: int = 0
    due: int = 0
    predicted: int = 0
    widest: float = 0.0
    """Widest interval of those that happened (s)."""

    def __str__(self) -> str:
        return (
            f"certain predictions                           {self.predictions}\n"
            f"  happened within their interval              {self.happened}\n"
            f"  prevented by an earlier third collision     {self.prevented}\n"
            f"  wrong                                       {self.wrong}\n"
            f"  widest interval that was confirmed          {self.widest:.1e} s\n"
            f"unresolved ones, near grazes                  {self.unresolved}\n"
            f"next collisions of all, one per step          {self.first}\n"
            f"  predicted, and within the interval          {self.first_happened}\n"
            f"collisions due within the horizon, per step   {self.due}\n"
            f"  predicted                                   {self.predicted}"
        )


class Flights:
    """The collisions of each body in order."""

    def __init__(self, collisions: NDArray[np.void]) -> None:
        self.times: dict[int, list[float]] = {}
        self.partners: dict[int, list[int]] = {}
        for time, a, b in collisions.tolist():
            for one, other in ((a, b), (b, a)):
                self.times.setdefault(one, []).append(time)
                self.partners.setdefault(one, []).append(other)

    def next(self, body: int, after: float) -> tuple[float, int]:
        """Return time (s) and partner of a moving body's next collision; infinite if there is none."""
        times = self.times.get(body, [])
        at = bisect_right(times, after)
        return (times[at], self.partners[body][at]) if at < len(times) else (np.inf, 0)


def compare(steps: Iterable[Predictions], collisions: NDArray[np.void], moving: int) -> Confirmation:
    """Compare the predictions of steps with the collisions (time, a, b by object id); bodies 1 to `moving` move."""
    result, flights = Confirmation(), Flights(collisions)
    times = collisions["time"]
    for now, predictions in steps:
        possible = predictions[predictions["status"] <= UNRESOLVED]
        found = {(int(p["id_a"]), int(p["id_b"])): (now + p["lower"], now + p["upper"]) for p in possible}
        certain = [pair for pair, status in zip(found, possible["status"], strict=True) if status == HIT]
        result.unresolved += len(found) - len(certain)
        for pair in certain:
            lower, upper = found[pair]
            following = [(*flights.next(body, now), body) for body in pair if body <= moving]
            when, partner, body = min(following)
            result.predictions += 1
            if {body, partner} == set(pair):
                inside = lower - ROUND_OFF <= when <= upper + ROUND_OFF
                result.happened += inside
                result.wrong += not inside
                result.widest = max(result.widest, upper - lower)
            elif when <= upper:
                result.prevented += 1
            else:
                result.wrong += 1
        at = bisect_right(times, now)
        if at < len(times) and times[at] < now + HORIZON:
            a, b = int(collisions["a"][at]), int(collisions["b"][at])
            lower, upper = found.get((min(a, b), max(a, b)), (np.inf, -np.inf))
            result.first += 1
            result.first_happened += lower - ROUND_OFF <= times[at] <= upper + ROUND_OFF
        for body in range(1, moving + 1):
            when, partner = flights.next(body, now)
            if when < now + HORIZON and (partner > moving or flights.next(partner, now) == (when, body)):
                if partner <= moving and partner < body:
                    continue  # counted already
                result.due += 1
                result.predicted += (min(body, partner), max(body, partner)) in found
    return result


def by_object_id(collisions: NDArray[np.void], moving: int) -> NDArray[np.void]:
    """Return the collisions with object ids: spheres from 1, then the six walls in the scene's order."""
    named = collisions.copy()
    named["a"] += 1
    named["b"] = np.where(named["b"] < 0, moving - named["b"], named["b"] + 1)
    return named


def in_process(scene: HardSpheresScene, duration: float) -> Iterator[Predictions]:
    """Step a monitor with the scene, and yield its predictions."""
    from collision_monitor.monitor.monitor import Monitor

    monitor = Monitor()
    for description in scene.descriptions:
        monitor.describe(description)
    for tick in range(round(duration * scene.rate)):
        result = monitor.step(round(scene.time * 1e9), scene.states())
        yield tick / scene.rate, result.predictions
        scene.step()


def recorded(session: Path) -> Iterator[Predictions]:
    """Yield the predictions of a session; time 0 is the stamp of its first states."""
    from collision_monitor import codec
    from collision_monitor.pipeline.topics import Topic
    from collision_monitor.session import Session

    start = None
    for message in Session(session).messages():
        if message.type == Topic.STATES.message and start is None:
            start = codec.decode_states(message.data).stamp_ns
        if message.type == Topic.PREDICTIONS.message and start is not None:
            answer = codec.decode_predictions(message.data)
            yield (answer.stamp_ns - start) * 1e-9, answer.predictions


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=200, help="number of spheres (default: 200)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the scene (default: 1)")
    parser.add_argument("--duration", type=float, default=30.0, help="simulated time (s, default: 30)")
    parser.add_argument("--session", type=Path, help="recording of a node that watched this scene")
    args = parser.parse_args()
    scene, again = (make_scene("hard_spheres", objects=args.objects, seed=args.seed) for _ in range(2))
    assert isinstance(scene, HardSpheresScene) and isinstance(again, HardSpheresScene)
    steps = list(recorded(args.session) if args.session else in_process(scene, args.duration))
    truth = again.spheres.run(steps[-1][0] + 2 * HORIZON, record=True)
    print(f"{args.objects} spheres, {len(steps)} steps, {len(truth)} collisions")
    print(compare(steps, by_object_id(truth, args.objects), args.objects))


if __name__ == "__main__":
    main()
