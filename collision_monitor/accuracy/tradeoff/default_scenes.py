"""Scenes that are measured by default, with their noise and duration."""

from __future__ import annotations

from typing import Final

MESH_SCENE: Final = "arm"
"""Scene that measures models of its shapes, in place of profiles."""

TRACK_SCENE: Final = "trajectory"

DEFAULT_SCENES: Final = ("fleet", "clutter", "swarm", "particles", "crossing", MESH_SCENE)
"""Scenes that are measured if none is named. A path adds TRACK_SCENE."""

STATE_NOISE: Final = {"fleet": 0.005}
"""Default noise of the states of a scene. If no scene is named, its exact states are measured too."""

DEFAULT_DURATION: Final = 5.0
"""Duration of a scene (s)."""
