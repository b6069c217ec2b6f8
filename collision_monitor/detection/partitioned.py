"""Full detection with a broad phase of choice, for comparison with the compiled grid.

The pairs and their order are those of the compiled frame; distances agree within their error bounds.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.broad_phase.boxes import in_order
from collision_monitor.broad_phase.partitions import PARTITIONS
from collision_monitor.detection.kernels import DETECTED
from collision_monitor.errors import InputError
from collision_monitor.narrow_phase.contact_row import as_contacts
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.shapes.pose import rotation_matrix

Array = NDArray[np.float64]

BROAD_PHASES: Final = ("grid", *(name.replace(" ", "-").lower() for name in PARTITIONS if name != "grid"))
"""Names of the broad phases of `Detector`: "grid" is the compiled one, the others are those of `PARTITIONS`."""

MOST_FOR_BRUTE_FORCE: Final = 5000
"""Most objects for brute force, whose memory grows with the square of their number: 25 MB times a few."""


def check_broad_phase(name: str, count: int) -> str:
    """Return the name of a broad phase. Raises InputError for an unknown one, or too many objects for it."""
    if name not in BROAD_PHASES:
        raise InputError(f"broad phase: expected one of {', '.join(BROAD_PHASES)}, got {name!r}")
    if name == "brute-force" and count > MOST_FOR_BRUTE_FORCE:
        raise InputError(f"broad phase brute-force: expected at most {MOST_FOR_BRUTE_FORCE} objects, got {count}")
    return name


def detect_with(
    name: str,
    table: Any,
    radius: Array,
    movable: NDArray[np.bool_],
    margin: float,
    positions: Array,
    quaternions: Array,
) -> tuple[NDArray[np.int32], Array]:
    """Pairs (M, 2) of objects within `margin` (m) and their rows of DETECTED (M, 14), sorted by pair.

    radius (N,): bounding radii with half of the margin (m), infinite for unbounded shapes; movable (N,).
    """
    partition = next(found for key, found in PARTITIONS.items() if key.replace(" ", "-").lower() == name)
    bounded = np.flatnonzero(np.isfinite(radius))
    centre, half = positions[bounded], radius[bounded, None]
    found = bounded[partition(centre - half, centre + half)]
    everywhere = np.flatnonzero(~np.isfinite(radius))
    i, j = (each.ravel() for each in np.meshgrid(everywhere, np.arange(len(radius)), indexing="ij"))
    once = (i != j) & ((i < j) | np.isfinite(radius[j]))  # two unbounded ones meet once
    candidates = in_order(np.concatenate([found.reshape(-1, 2), np.stack([i, j], axis=1)[once]]))
    pairs: NDArray[np.int32] = candidates[movable[candidates].any(axis=1)].astype(np.int32)
    rows = contact_batch(table, positions, rotation_matrix(quaternions), pairs)
    contacts = as_contacts(rows)
    near = contacts["distance"] <= margin
    pairs, contacts = pairs[near], contacts[near]
    origin = positions[pairs[:, 0]]
    out = np.zeros(len(pairs), DETECTED)
    out["signed_distance"], out["error_bound"], out["normal"] = (
        contacts["distance"], contacts["bound"], contacts["normal"],
    )  # fmt: skip
    out["point_a"], out["point_b"] = origin + contacts["point_a"], origin + contacts["point_b"]
    out["point"] = out["point_a"] + 0.5 * (out["point_b"] - out["point_a"])
    return pairs, out.view(np.float64).reshape(len(pairs), -1)
