"""A contact at exactly the contact margin: reported where the error bound allows it, in either order."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import collision_monitor as cm

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
CUBE = list(product((-0.5, 0.5), repeat=3))
SHAPES: dict[str, cm.Shape] = {
    "sphere": cm.Sphere(0.5),
    "box": cm.Box((1.0, 1.0, 1.0)),
    "capsule": cm.Capsule(0.5, 1.0),
    "cylinder": cm.Cylinder(0.5, 1.0),
    "ellipsoid": cm.Ellipsoid((0.5, 0.5, 0.5)),
    "hull": cm.ConvexHull(CUBE),
    "rounded box": cm.RoundedBox((1.0, 1.0, 1.0), 0.2),
    "cloud": cm.Points([(0.4, 0.0, 0.0), (-0.4, 0.0, 0.0)], 0.1),
}
"""Each reaches 0.5 m along x."""


@pytest.mark.parametrize("profile", ["balanced", "exact", "fast"])
@pytest.mark.parametrize(("a", "b"), list(product(SHAPES, SHAPES)))
def test_a_distance_of_the_margin_is_a_contact(a: str, b: str, profile: str) -> None:
    for margin in (0.0, 0.125, 0.25):
        monitor = cm.Monitor(cm.Profile.named(profile).replace(contact_margin=margin))
        monitor.add(1, SHAPES[a])
        monitor.add(2, SHAPES[b])
        found = monitor.step(0, [1, 2], np.array([[0.0, 0, 0, *UPRIGHT], [1.0 + margin, 0, 0, *UPRIGHT]])).contacts
        assert len(found) == 1, f"{a} and {b} at the margin {margin}: {found}"
        assert abs(found["signed_distance"][0] - margin) <= found["error_bound"][0] + 1e-15
