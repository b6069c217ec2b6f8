"""The plans that a session holds: the last one of each object, with the shapes of all objects."""

from __future__ import annotations

from pathlib import Path

from collision_monitor.codec import decode_descriptions, decode_trajectories
from collision_monitor.codec.trajectories import ObjectTrajectory
from collision_monitor.errors import CollisionMonitorError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.plan_intake import trajectory_of
from collision_monitor.pipeline.topics import Topic
from collision_monitor.query.conflicts.planned_scene import DatedPlan, PlannedScene
from collision_monitor.session.reader import Session
from collision_monitor.shapes.pose import Pose

_INPUTS = tuple(topic.message.rpartition("/")[2] for topic in (Topic.SHAPES, Topic.TRAJECTORIES))


def recorded_plans(path: Path) -> PlannedScene:
    """Return the objects of a session, or of a bag with a monitor's inputs. Raises SessionError.

    An object that moves without a plan is left out, with a text that says so.
    """
    described: dict[int, ObjectDescription] = {}
    plans: dict[int, tuple[int, ObjectTrajectory]] = {}
    scene, session = PlannedScene(), Session(path)
    for each in session.messages():
        if each.type not in _INPUTS:
            continue
        try:
            if each.type == _INPUTS[0]:
                array = decode_descriptions(each.data)
                if array.snapshot:
                    described.clear()
                scene.left_out += [f"{path}, object {object_id}: {text}" for object_id, text in array.refused]
                for change in array.objects:
                    if isinstance(change, ObjectDescription):
                        described[change.object_id] = change
                    else:
                        described.pop(change.object_id, None)
            else:
                message = decode_trajectories(each.data)
                plans |= {plan.object_id: (message.stamp_ns, plan) for plan in message.trajectories}
        except CollisionMonitorError as error:
            scene.left_out.append(f"{path}, {each.topic}: {error}")
    scene.left_out += [f"{path}: {text}" for text in session.damage]
    for object_id, it in sorted(described.items()):
        name = it.name or f"object {object_id}"
        if name in scene.static or name in scene.shapes:
            name = f"{name} ({object_id})"
        given = plans.pop(object_id, None)
        if it.static:
            scene.static[name] = tuple(it.shapes), it.pose or Pose()
        elif given is None or not len(given[1].times):
            scene.left_out.append(f"{path}, {name}: it has no plan")
        else:
            try:
                scene.plans[name] = DatedPlan(given[0], trajectory_of(given[1]))
                scene.shapes[name] = tuple(it.shapes)
            except CollisionMonitorError as error:
                scene.left_out.append(f"{path}, {name}: {error}")
    scene.left_out += [f"{path}: a plan of object {each}, which is not described" for each in plans]
    return scene
