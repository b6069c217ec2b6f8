"""Simulated worlds for demos, tests and benchmarks: scenes, and what bodies do when they meet."""

from collision_monitor.world.scene import Scene
from collision_monitor.world.scenes import describe, make_scene, scene_names

__all__ = ["Scene", "describe", "make_scene", "scene_names"]
