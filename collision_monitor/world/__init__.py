"""Simulated worlds for demos, tests and benchmarks: scenes, and the collision response of bodies."""

from collision_monitor.world.scene import Scene
from collision_monitor.world.scenes import describe, make_scene, scene_names

__all__ = ["Scene", "describe", "make_scene", "scene_names"]
