"""Impacts of the samples of two balls, or of two parallel cylinders, that move straight: closed forms."""

from __future__ import annotations

from math import inf

from collision_monitor._jit import device
from collision_monitor.geometry.shape_table import CYLINDER, SPHERE
from collision_monitor.narrow_phase.cylinder_cylinder import is_parallel
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.prediction.bodies import place_shape
from collision_monitor.prediction.sample_count import latest, samples_needed
from collision_monitor.prediction.straight_samples import draw_evenly, enter_cylinder, enter_sphere, set_errors


@device
def are_round(table, parts, pair, errors, margin, work):
    """Whether bodies with these first shapes are two balls, or two parallel cylinders, that move straight."""
    A, B, a, b = pair
    turning = errors.turning
    if parts.next[a] >= 0 or parts.next[b] >= 0 or errors.bend > 0.0:
        return False
    if turning[0][0] + turning[0][1] + turning[1][0] + turning[1][1] > 0.0:
        return False
    if table.kind[a] == SPHERE and table.kind[b] == SPHERE:
        return True
    if not (table.kind[a] == table.kind[b] == CYLINDER) or table.margin[a] + table.margin[b] + margin > 0.0:
        return False
    R_a, R_b = work.scratch.rotation[0], work.scratch.rotation[1]
    place_shape(table, parts, a, A.rotation, R_a)
    place_shape(table, parts, b, B.rotation, R_b)
    return is_parallel(table, a, PairPose(R_a, R_b, (0.0, 0.0, 0.0)))


@device
def _enter_round(table, parts, pair, end, margin, first, last, memory, work):
    """Write the impacts of the samples first:last of bodies for which `are_round` holds into memory.times."""
    A, B, a, b = pair
    R = work.scratch.rotation
    oa, ob = place_shape(table, parts, a, A.rotation, R[0]), place_shape(table, parts, b, B.rotation, R[1])
    p = (B.x - A.x + ob[0] - oa[0], B.y - A.y + ob[1] - oa[1], B.z - A.z + ob[2] - oa[2])
    v = (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
    if table.kind[a] == SPHERE:
        enter_sphere(p, v, table.radius[a] + table.radius[b] + margin, end, memory.off, first, last, memory.times)
        return
    axis, size = (R[1, 0, 2], R[1, 1, 2], R[1, 2, 2]), table.size
    half = size[a, 1] + size[b, 1]
    enter_cylinder(p, v, axis, size[a, 0] + size[b, 0], half, end, memory.off, first, last, memory.times)


@device
def enter_round_bodies(table, parts, pair, errors, sure, sampling, lattice, memory, work):
    """Write the times of the samples' impacts of bodies for which `are_round` holds into memory.times.

    work.joint: root of the covariance of the pair; sure: they surely meet. Returns the number of samples, see
    `samples_needed`, and whether they have equal weights.
    """
    margin, end, pilot, points = sampling.query.margin, sampling.horizon, lattice.pilot, lattice.points
    first, samples, is_even = 0, pilot, sure
    if not sure:
        set_errors(work.joint, work.frame, errors.time, points, 0, pilot, memory.off)
        _enter_round(table, parts, pair, end, margin, 0, pilot, memory, work)
        samples, is_even = samples_needed(memory.times, lattice, sampling), latest(memory.times, pilot) < inf
        first = 0 if is_even else pilot
    if is_even:
        draw_evenly(work.joint)
    if first < samples:
        set_errors(work.joint, work.frame, errors.time, points, first, samples, memory.off)
        _enter_round(table, parts, pair, end, margin, first, samples, memory, work)
    return samples, is_even
