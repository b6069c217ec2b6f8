"""Predicted paths of objects, and tubes around them that show how uncertain they are."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.view.bodies import Floats, Indices
from collision_monitor.view.moment import Moment

SAMPLES: Final = 12
"""Points of a path."""

SIGMAS: Final = 1.96
"""Radius of a tube in standard deviations: along any one line through its axis, 95 % of a normal distribution."""

_SIDES: Final = 16
_CAP: Final = 4
"""Rings of each rounded end."""


def paths(moment: Moment, rows: Indices, until: Floats) -> Floats:
    """Return points (k, SAMPLES, 3) in m of the objects' origins, from the step until `until` (k,) s later."""
    times = np.linspace(0.0, 1.0, SAMPLES) * until[:, None]
    position, _ = moment.poses_at(np.repeat(rows, SAMPLES), times.ravel())
    return position.reshape(-1, SAMPLES, 3)


def radii(moment: Moment, rows: Indices, until: Floats) -> Floats:
    """Return the radii (k, SAMPLES) in m of the tubes around `paths`; 0 for objects that declare no uncertainty.

    SIGMAS times the standard deviation of the position, which grows by that of the velocity, plus what the largest
    acceleration of the object adds.
    """
    state = moment.state[rows]
    time = np.linspace(0.0, 1.0, SAMPLES) * until[:, None] + moment.age[rows][:, None]
    position, velocity = (np.nan_to_num(state[name])[:, None] for name in ("position_stddev", "velocity_stddev"))
    described = moment.bodies.descriptions
    acceleration = np.array([described[body].max_linear_acceleration for body in moment.body[rows]])
    sigma: Floats = np.hypot(position, velocity * time)
    return SIGMAS * sigma + 0.5 * acceleration[:, None] * time**2


def tubes(path: Floats, radius: Floats) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return one mesh of closed tubes with rounded ends: vertices (v, 3) in m and faces (f, 3).

    path (k, n, 3), radius (k, n): in m. An object at rest gets a ball.
    """
    count, samples = radius.shape
    along = np.gradient(path, axis=1)
    length = np.linalg.norm(along, axis=2, keepdims=True)
    still = length < 1e-9
    along = np.where(still, (0.0, 0.0, 1.0), along / np.where(still, 1.0, length))
    turn = np.linspace(0.0, np.pi / 2, _CAP, endpoint=False)
    centres = [
        path[:, :1] - (radius[:, :1] * np.cos(turn))[..., None] * along[:, :1],
        path,
        path[:, -1:] + (radius[:, -1:] * np.cos(turn[::-1]))[..., None] * along[:, -1:],
    ]
    rings = [radius[:, :1] * np.sin(turn), radius, radius[:, -1:] * np.sin(turn[::-1])]
    axes = [np.repeat(along[:, :1], _CAP, axis=1), along, np.repeat(along[:, -1:], _CAP, axis=1)]
    centre, ring, axis = (np.concatenate(parts, axis=1) for parts in (centres, rings, axes))
    helper = np.eye(3)[np.argmin(np.abs(axis[:, :1]), axis=2)]  # one for each tube, so that it is not twisted
    u = np.cross(helper, axis)
    u /= np.linalg.norm(u, axis=2, keepdims=True)
    v = np.cross(axis, u)
    angle = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)[:, None]
    round_ = np.cos(angle) * u[:, :, None] + np.sin(angle) * v[:, :, None]
    vertices = centre[:, :, None] + ring[:, :, None, None] * round_
    number = samples + 2 * _CAP
    low = np.arange(number - 1)[:, None] * _SIDES + np.arange(_SIDES)
    right = np.roll(low, -1, axis=1)
    one = np.stack([low, right, right + _SIDES, low, right + _SIDES, low + _SIDES], axis=-1).reshape(-1, 3)
    faces = one + (np.arange(count) * number * _SIDES)[:, None, None]
    return vertices.reshape(-1, 3).astype(np.float32), faces.reshape(-1, 3).astype(np.uint32)
