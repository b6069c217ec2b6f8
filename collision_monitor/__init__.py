"""Collision monitoring: current contacts, predicted collisions with their times, and the uncertainty of both.

    monitor.monitor                Monitor, StepResult, StepStatus        states in, contacts and predictions out
    settings.profile               Profile                                the settings that trade speed for accuracy
    shapes.kinds, shapes.pose      Sphere, Box, …, Pose, Motion           shapes of objects, and their poses
    shapes.mesh_file               load_mesh                              a mesh from a file
    robots.robot                   Robot                                  a URDF: its links along their joints
    objects.description            ObjectDescription                      an object with its shapes, group and bounds
    objects.convex_decomposition   convex_decomposition, Decomposition    a concave mesh as convex parts, with an error
    query.contact.contact          contact, Contact                       two shapes: distance, normal, points, bound
    query.contact.features         contact_features                       features: "vertex 3 of A on face 7 of B"
    query.contact.overlap          overlap                                yes or no, with a choice of tests
    query.points.containment       contains                              which points are in a shape
    query.points.rays              cast_ray, RayHits                     where rays and segments meet a shape
    query.points.points_within     points_within                         which points of a cloud are near a shape
    query.points.kdop              kdop, Enclosure                       bounding slabs with directions of your own
    query.impact.time_of_impact    time_of_impact, Impact                 time of impact of two shapes, as an interval
    query.conflicts.conflicts      conflicts, Conflict                    plans of many objects, and a static world
    query.impact.feature_impact    vertex_face_impact, edge_edge_impact   the same for features in linear motion
    response                       response.collide, reflect, …           what bodies do when they meet, for simulations
    records                        Model                                  the geometric models of an object
    errors                         CollisionMonitorError and subclasses   errors of the inputs
    world                          world.HardSpheres, world.make_scene    simulated worlds to monitor

This module exports the names in the second column, such as `collision_monitor.contact`. Each name is imported at its
first use.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collision_monitor._version import VERSION as __version__  # noqa: N811

_HOME = {
    "Monitor": "monitor.monitor",
    "StepResult": "monitor.result",
    "StepStatus": "monitor.result",
    "Profile": "settings.profile",
    "ObjectDescription": "objects.description",
    "Model": "records",
    "Pose": "shapes.pose",
    "Motion": "motion.stated_motion",
    "Trajectory": "motion.trajectory",
    "Tolerance": "motion.trajectory",
    "Robot": "robots.robot",
    "load_mesh": "shapes.mesh_file",
    "contact": "query.contact.contact",
    "Contact": "query.contact.contact",
    "contact_features": "query.contact.features_in_contact",
    "overlap": "query.contact.overlap",
    "distance": "query.contact.distance",
    "contacts": "query.contact.contacts",
    "Contacts": "query.contact.contacts",
    "times_of_impact": "query.impact.times_of_impact",
    "impacts": "query.impact.contact_intervals",
    "ContactInterval": "query.impact.contact_intervals",
    "conflicts": "query.conflicts.conflicts",
    "Conflict": "query.conflicts.conflicts",
    "contains": "query.points.containment",
    "cast_ray": "query.points.rays",
    "points_within": "query.points.points_within",
    "RayHits": "query.points.rays",
    "kdop": "query.points.kdop",
    "Enclosure": "query.points.kdop",
    "convex_decomposition": "objects.convex_decomposition",
    "Decomposition": "objects.convex_decomposition",
    "time_of_impact": "query.impact.time_of_impact",
    "Impact": "query.impact.impact",
    "time_of_impact_batch": "query.impact.times_of_impact",
    "Impacts": "query.impact.times_of_impact",
    "vertex_face_impact": "query.impact.feature_impact",
    "edge_edge_impact": "query.impact.feature_impact",
    "FeatureImpact": "query.impact.feature_impact",
    "plot": "query.contact.contact_plot",
    "CollisionMonitorError": "errors",
    "InputError": "errors",
    "ShapeError": "errors",
    "PoseError": "errors",
    "ProfileError": "errors",
    "UnsupportedError": "errors",
    "MessageError": "errors",
    "SessionError": "errors",
    "Refusal": "errors",
    "RefusalWarning": "errors",
}
_HOME |= {  # the shapes: kinds/truncated_cone.py has the class TruncatedCone
    file.stem.title().replace("_", ""): f"shapes.kinds.{file.stem}"
    for file in sorted((Path(__file__).parent / "shapes" / "kinds").glob("[a-z]*.py"))
}
_MODULES = ("response", "world")
__all__ = ["__version__", *_MODULES, *_HOME]

if TYPE_CHECKING:
    from collision_monitor import response as response
    from collision_monitor import world as world
    from collision_monitor.errors import CollisionMonitorError as CollisionMonitorError
    from collision_monitor.errors import InputError as InputError
    from collision_monitor.errors import MessageError as MessageError
    from collision_monitor.errors import PoseError as PoseError
    from collision_monitor.errors import ProfileError as ProfileError
    from collision_monitor.errors import Refusal as Refusal
    from collision_monitor.errors import RefusalWarning as RefusalWarning
    from collision_monitor.errors import SessionError as SessionError
    from collision_monitor.errors import ShapeError as ShapeError
    from collision_monitor.errors import UnsupportedError as UnsupportedError
    from collision_monitor.monitor.monitor import Monitor as Monitor
    from collision_monitor.monitor.result import StepResult as StepResult
    from collision_monitor.monitor.result import StepStatus as StepStatus
    from collision_monitor.motion.stated_motion import Motion as Motion
    from collision_monitor.motion.trajectory import Tolerance as Tolerance
    from collision_monitor.motion.trajectory import Trajectory as Trajectory
    from collision_monitor.objects.convex_decomposition import Decomposition as Decomposition
    from collision_monitor.objects.convex_decomposition import convex_decomposition as convex_decomposition
    from collision_monitor.objects.description import ObjectDescription as ObjectDescription
    from collision_monitor.query.conflicts.conflicts import Conflict as Conflict
    from collision_monitor.query.conflicts.conflicts import conflicts as conflicts
    from collision_monitor.query.contact.contact import Contact as Contact
    from collision_monitor.query.contact.contact import contact as contact
    from collision_monitor.query.contact.contact_plot import plot as plot
    from collision_monitor.query.contact.contacts import Contacts as Contacts
    from collision_monitor.query.contact.contacts import contacts as contacts
    from collision_monitor.query.contact.distance import distance as distance
    from collision_monitor.query.contact.features_in_contact import contact_features as contact_features
    from collision_monitor.query.contact.overlap import overlap as overlap
    from collision_monitor.query.impact.contact_intervals import ContactInterval as ContactInterval
    from collision_monitor.query.impact.contact_intervals import impacts as impacts
    from collision_monitor.query.impact.feature_impact import FeatureImpact as FeatureImpact
    from collision_monitor.query.impact.feature_impact import edge_edge_impact as edge_edge_impact
    from collision_monitor.query.impact.feature_impact import vertex_face_impact as vertex_face_impact
    from collision_monitor.query.impact.impact import Impact as Impact
    from collision_monitor.query.impact.time_of_impact import time_of_impact as time_of_impact
    from collision_monitor.query.impact.times_of_impact import Impacts as Impacts
    from collision_monitor.query.impact.times_of_impact import time_of_impact_batch as time_of_impact_batch
    from collision_monitor.query.impact.times_of_impact import times_of_impact as times_of_impact
    from collision_monitor.query.points.containment import contains as contains
    from collision_monitor.query.points.kdop import Enclosure as Enclosure
    from collision_monitor.query.points.kdop import kdop as kdop
    from collision_monitor.query.points.points_within import points_within as points_within
    from collision_monitor.query.points.rays import RayHits as RayHits
    from collision_monitor.query.points.rays import cast_ray as cast_ray
    from collision_monitor.records import Model as Model
    from collision_monitor.robots.robot import Robot as Robot
    from collision_monitor.settings.profile import Profile as Profile
    from collision_monitor.shapes.mesh_file import load_mesh as load_mesh
    from collision_monitor.shapes.pose import Pose as Pose
    from collision_monitor.shapes.registry import *  # noqa: F403


def __getattr__(name: str) -> Any:
    """Import the name at its first use, so that `collision-monitor --help` does not wait for the kernels."""
    if name in _MODULES:
        return import_module(f"{__name__}.{name}")
    if name not in _HOME:
        # with name and obj, Python suggests the nearest name
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name, obj=sys.modules[__name__])
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Include the names of the API that are not imported yet, for tab completion."""
    return sorted({*globals(), *__all__})
