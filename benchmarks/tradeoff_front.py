"""Draw docs/images/tradeoff.png: the Pareto fronts of scenes of 100, 1,000 and 10,000 objects and of meshes.

    python benchmarks/tradeoff_front.py --png docs/images/tradeoff.png      # some minutes
    python benchmarks/tradeoff_front.py --sizes 100 --seconds 1             # a quick look

Each scene is measured with true states and with noise of 5 mm, 5 mrad, 5 mm/s and 5 mrad/s that the states declare.
FCL and Coal (if they are installed) answer the same contacts: with the shapes, and with boxes or spheres around them.
FCL predicts the same pairs with `continuousCollide`, for some tolerances. Their time is that of the calls for these
pairs alone, from Python and without a broad phase. Errors are relative to our exact answers.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

from collision_monitor.accuracy.inputs import Workload, simulated
from collision_monitor.accuracy.playback import Step
from collision_monitor.accuracy.reported import Reported
from collision_monitor.accuracy.tradeoff.profile_tradeoff import exact_answers
from collision_monitor.accuracy.tuning.front import Front, front_settings, measure_front
from collision_monitor.accuracy.tuning.front_picture import Peer, draw_fronts
from collision_monitor.objects.models import containing_model
from collision_monitor.records import PredictionStatus
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose, from_rotation_vector, multiply, rotation_matrix
from collision_monitor.shapes.registry import Box, Capsule, Cylinder, Shape, Sphere

NOISE = 0.005
MOST_PAIRS = 2_000
"""Pairs that each setting of a peer answers."""
TOLERANCES = (1e-2, 1e-3, 1e-4)
HORIZON = 2.0


def stand_in(shape: Shape, model: str) -> tuple[Shape, Pose]:
    """A shape or the box or sphere around it, with its pose."""
    if model == "shapes":
        return shape, Pose()
    piece, pose = containing_model([(shape, Pose())], model).pieces[0]
    return piece, pose


def with_fcl(shape: Shape) -> Any:
    """An FCL geometry; None for other kinds of shapes."""
    import fcl

    match shape:
        case Box():
            return fcl.Box(*shape.size)
        case Sphere():
            return fcl.Sphere(shape.radius)
        case Capsule():
            return fcl.Capsule(shape.radius, shape.length)
        case Cylinder():
            return fcl.Cylinder(shape.radius, shape.length)
    return None


def with_coal(shape: Shape) -> Any:
    """A Coal geometry; None for other kinds of shapes."""
    import coal

    match shape:
        case Box():
            return coal.Box(*shape.size)
        case Sphere():
            return coal.Sphere(shape.radius)
        case Capsule():
            return coal.Capsule(shape.radius, shape.length)
        case Cylinder():
            return coal.Cylinder(shape.radius, shape.length)
    return None


def fcl_distance(a: tuple[Any, Any], b: tuple[Any, Any]) -> float:
    """Signed distance of two placed geometries: minus the depth of the deepest contact."""
    import fcl

    one, two = (fcl.CollisionObject(g, fcl.Transform(R, p)) for g, (R, p) in (a, b))
    result = fcl.CollisionResult()
    if not fcl.collide(one, two, fcl.CollisionRequest(num_max_contacts=8, enable_contact=True), result):
        return fcl.distance(one, two, fcl.DistanceRequest(), fcl.DistanceResult())  # type: ignore[no-any-return]
    return -max(each.penetration_depth for each in result.contacts)


def coal_distance(a: tuple[Any, Any], b: tuple[Any, Any]) -> float:
    """As `fcl_distance`, in one call."""
    import coal

    result = coal.DistanceResult()
    one, two = (coal.Transform3s(R, p) for _, (R, p) in (a, b))
    return coal.distance(a[0], one, b[0], two, coal.DistanceRequest(), result)  # type: ignore[no-any-return]


def peers_of(work: Workload) -> Iterator[Peer]:
    """Measure the peers on the contacts and the predicted pairs of every few steps."""
    chosen = [work.steps[k] for k in np.unique(np.linspace(0, len(work.steps) - 1, 8).astype(int))]
    truth, count = exact_answers(work.descriptions, chosen, Profile(), lambda done: None)
    shapes = {each.object_id: each.shapes[0][0] for each in work.descriptions if len(each.shapes) == 1}
    for name, make, measure in (("FCL", with_fcl, fcl_distance), ("Coal", with_coal, coal_distance)):
        try:
            for model in ("shapes", "obb", "sphere"):
                yield from _distances(f"{name}, {model}", make, measure, model, shapes, chosen, truth, count)
        except ImportError:
            print(f"{name} is not installed")
    with suppress(ImportError):
        yield from _times(shapes, chosen, truth, count)


def _placed(made: Any, offset: Pose, state: np.void) -> tuple[Any, Any]:
    pose = Pose(state["position"], state["quaternion"]) @ offset
    return made, (rotation_matrix(pose.quaternion), np.asarray(pose.position))


def _distances(
    name: str,
    make: Callable[[Shape], Any],
    measure: Callable[[Any, Any], float],
    model: str,
    shapes: Mapping[int, Shape],
    steps: Sequence[Step],
    truth: Reported,
    count: int,
) -> Iterator[Peer]:
    geometry = {}
    for i, shape in shapes.items():
        piece, offset = stand_in(shape, model)
        if (made := make(piece)) is not None:
            geometry[i] = made, offset
    errors, spent, pairs = [], 0.0, 0
    for k, (_, states) in enumerate(steps):
        rows = truth.contacts[truth.contact_step == k][: MOST_PAIRS // len(steps)]
        state = {int(each["id"]): each for each in states}
        for row in rows:
            ids = int(row["id_a"]), int(row["id_b"])
            if not all(i in geometry and i in state for i in ids):
                continue
            a, b = (_placed(*geometry[i], state[i]) for i in ids)
            began = time.perf_counter()
            found = measure(a, b)
            spent, pairs = spent + time.perf_counter() - began, pairs + 1
            errors.append(abs(found - row["signed_distance"]))
    if pairs:
        per_step = len(truth.contacts) / count
        yield Peer(name, "distance", float(np.percentile(errors, 99)), 1e3 * spent / pairs * per_step)


def _times(shapes: Mapping[int, Shape], steps: Sequence[Step], truth: Reported, count: int) -> Iterator[Peer]:
    import fcl

    for tolerance in TOLERANCES:
        errors, spent, pairs = [], 0.0, 0
        request = fcl.ContinuousCollisionRequest(
            num_max_iterations=1000, toc_err=tolerance, ccd_motion_type=fcl.CCDMotionType.CCDM_LINEAR,
            ccd_solver_type=fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT,
        )  # fmt: skip
        for k, (_, states) in enumerate(steps):
            rows = truth.predictions[truth.prediction_step == k]
            rows = rows[rows["status"] == PredictionStatus.HIT][: MOST_PAIRS // len(steps) // 4]
            state = {int(each["id"]): each for each in states}
            for row in rows:
                ids = int(row["id_a"]), int(row["id_b"])
                made = [with_fcl(shapes[i]) if i in shapes and i in state else None for i in ids]
                if any(each is None for each in made):
                    continue
                moved = [_moved(state[i]) for i in ids]
                objects = [fcl.CollisionObject(g, fcl.Transform(*m[0])) for g, m in zip(made, moved, strict=True)]
                ends = [fcl.Transform(*m[1]) for m in moved]
                began = time.perf_counter()
                result = fcl.ContinuousCollisionResult()
                fcl.continuousCollide(objects[0], ends[0], objects[1], ends[1], request, result)
                spent, pairs = spent + time.perf_counter() - began, pairs + 1
                errors.append(abs(result.time_of_contact * HORIZON - row["lower"]))
        if pairs:
            per_step = len(truth.predictions) / count
            worst = float(np.percentile(errors, 99))
            yield Peer("FCL, conservative advancement", "time", worst, 1e3 * spent / pairs * per_step)


def _moved(state: np.void) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Rotation and position now, and after the horizon."""
    end = multiply(from_rotation_vector(state["angular"] * HORIZON), state["quaternion"])
    return (rotation_matrix(state["quaternion"]), state["position"].copy()), (
        rotation_matrix(end),
        state["position"] + state["linear"] * HORIZON,
    )


def main() -> None:
    """Measure and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="100,1000,10000", help="numbers of objects of the scene clutter")
    parser.add_argument("--seconds", type=float, default=2.0, help="duration of each scene")
    parser.add_argument("--png", type=Path, help="draw the fronts")
    parser.add_argument("--json", type=Path, help="write all rows to this file")
    args = parser.parse_args()
    scenes = [(f"clutter, {int(n):,} objects", "clutter", int(n)) for n in args.sizes.split(",")]
    scenes.append(("arm, 12 meshes", "arm", None))
    columns: dict[str, list[Front]] = {}
    peers: dict[str, list[Peer]] = {}
    with Progress() as bar:
        task = bar.add_task("fronts", total=2 * len(scenes))
        for title, name, count in scenes:
            columns[title] = []
            for noise in (0.0, NOISE):
                (work,) = simulated([name], objects=count, noise=noise, duration=args.seconds)
                columns[title].append(measure_front(work, front_settings(work), lambda done: None))
                bar.console.print(columns[title][-1].summary())
                if not noise:
                    peers[title] = list(peers_of(work))
                bar.advance(task)
    if args.png:
        draw_fronts(columns, args.png, peers)
    if args.json:
        rows = [row.to_dict() for fronts in columns.values() for front in fronts for row in front.rows]
        fixed = {f.label: f.fixed_us for fronts in columns.values() for f in fronts}
        others = {title: [each._asdict() for each in found] for title, found in peers.items()}
        args.json.write_text(json.dumps({"load": os.getloadavg()[0], "rows": rows, "fixed_us": fixed, "peers": others}))


if __name__ == "__main__":
    main()
