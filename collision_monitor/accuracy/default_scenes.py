"""The scenes that are measured where none is named, with their noise and their duration."""

from __future__ import annotations

from typing import Final

MESH_SCENE: Final = "arm"
"""The scene whose shapes matter, not its profile: its rows are models."""

TRACK_SCENE: Final = "trajectory"

DEFAULT_SCENES: Final = ("fleet", "clutter", "swarm", "particles", "crossing", MESH_SCENE)
"""The scenes that are measured where none is named; and TRACK_SCENE, where a path is given."""

STATE_NOISE: Final = {"fleet": 0.005}
"""Noise of the states of scenes, where none is given. Where no scene is named, the true states are measured too."""

DEFAULT_DURATION: Final = 5.0
"""s"""
