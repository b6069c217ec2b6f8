"""Perfectly inelastic collision of many bodies that turn: those that touch stay together and move as one body."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array, Indices
from collision_monitor.response.contact_set import Bodies


def groups(count: int, pairs: ArrayLike) -> Indices:
    """Group of each of `count` bodies: the smallest index to which pairs (M, 2) connect it."""
    i, j = np.asarray(pairs, dtype=np.int64).reshape(-1, 2).T
    label = np.arange(count)
    while len(i):
        low = np.minimum(label[i], label[j])
        before = label.copy()
        np.minimum.at(label, label[i], low)
        np.minimum.at(label, label[j], low)
        label = label[label]
        if (label == before).all() and (label[i] == label[j]).all():
            break
    return label


def move_as_one(bodies: Bodies, position: Array, pairs: ArrayLike) -> Bodies:
    """Bodies (N) with the velocities of their groups; pairs (M, 2) of indices stay together; position (N, 3) in m.

    A group keeps its momentum and angular momentum. A group with an immovable body rests with it.
    Slide "Inelastic Collisions": objects stick together, momentum is conserved; here with the angular momentum about
    the group's centre of mass. Raises InputError.
    """
    count = len(bodies.inverse_mass)
    index = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    if len(index) and not (index.min() >= 0 and index.max() < count):
        raise InputError(f"pairs: expected indices from 0 to {count - 1}, got {index.min()} to {index.max()}")
    label = groups(count, index)
    movable = bodies.inverse_mass > 0.0
    fixed = np.zeros(count, bool)
    fixed[label[~movable]] = True
    grouped = np.bincount(label, minlength=count) > 1
    one = grouped[label] & ~fixed[label]  # bodies that move with a group
    held = grouped[label] & fixed[label] & movable
    mass = 1.0 / np.where(movable, bodies.inverse_mass, 1.0)
    inertia = np.linalg.inv(np.where(movable[:, None, None], bodies.inverse_inertia, np.eye(3))[one])

    def total(values: Array) -> Array:
        """Sums over each group, for each of its bodies."""
        sums = np.zeros((count, *values.shape[1:]))
        np.add.at(sums, label[one], values)
        return sums[label[one]]

    m, x, v = mass[one, None], position[one], bodies.velocity[one]
    whole = total(m)
    centre, mean = total(m * x) / whole, total(m * v) / whole
    arm = x - centre
    squares = np.einsum("ni,ni->n", arm, arm)[:, None, None] * np.eye(3) - arm[:, :, None] * arm[:, None, :]
    turning = total(inertia + m[:, :, None] * squares)
    momentum = total(m * np.cross(arm, v - mean) + np.einsum("nij,nj->ni", inertia, bodies.angular[one]))
    angular = np.linalg.solve(turning, momentum[..., None])[..., 0] if one.any() else momentum
    velocity, spin = bodies.velocity.copy(), bodies.angular.copy()
    velocity[one], spin[one] = mean + np.cross(angular, arm), angular
    velocity[held] = spin[held] = 0.0
    return bodies._replace(velocity=velocity, angular=spin)
