"""Simulated worlds for demos, tests and benchmarks: scenes, collision response, and event-driven hard spheres.

>>> scene = make_scene("fleet", objects=4)
>>> len(scene.step(0.1))  # states of the objects after 0.1 s
4
"""

from typing import TYPE_CHECKING, Any

from collision_monitor.world.scene import Scene
from collision_monitor.world.scenes import check_path, describe, make_scene, scene_names

if TYPE_CHECKING:
    from collision_monitor.world.hard_spheres.simulation import HardSpheres as HardSpheres

__all__ = ["HardSpheres", "Scene", "check_path", "describe", "make_scene", "scene_names"]


def __getattr__(name: str) -> Any:
    """Import `HardSpheres` at its first use, so that names and help of the scenes do not wait for its kernels."""
    if name != "HardSpheres":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from collision_monitor.world.hard_spheres.simulation import HardSpheres

    return HardSpheres
