"""Zones against brute force: the sign by a count of crossings, the distance by samples of the surface."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor.alerts.zones import BoxZone, HalfSpaceZone, PolygonZone

POINTS = np.random.default_rng(3).uniform(-4.0, 4.0, (400, 3))
L_SHAPE = ((-2.0, -2.0), (2.0, -2.0), (2.0, 0.0), (0.0, 0.0), (0.0, 2.5), (-2.0, 2.5))


def _in_polygon(point: np.ndarray, corners: np.ndarray) -> bool:
    """The even-odd rule, edge by edge."""
    inside = False
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if (a[1] > point[1]) != (b[1] > point[1]):
            x = a[0] + (point[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            inside ^= bool(point[0] < x)
    return inside


def _prism_surface(corners: np.ndarray, low: float, high: float) -> np.ndarray:
    """Points on the surface of a prism, 0.05 m apart."""
    grid = np.stack(np.meshgrid(np.arange(-2, 2.6, 0.05), np.arange(-2, 2.6, 0.05)), -1).reshape(-1, 2)
    cover = grid[[_in_polygon(p, corners) for p in grid]]
    caps = [np.column_stack([cover, np.full(len(cover), z)]) for z in (low, high)]
    sides = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = a + np.linspace(0, 1, 90)[:, None] * (b - a)
        sides += [np.column_stack([along, np.full(len(along), z)]) for z in np.linspace(low, high, 60)]
    return np.concatenate([*caps, *sides])


@pytest.mark.parametrize("corners", [L_SHAPE, L_SHAPE[::-1]], ids=["counter-clockwise", "clockwise"])
def test_a_polygon_against_samples_of_its_surface(corners: tuple[tuple[float, float], ...]) -> None:
    a = np.array(corners)
    found = PolygonZone(corners, (-1.0, 1.5)).distance(POINTS)
    inside = [_in_polygon(p, a) and -1.0 <= p[2] <= 1.5 for p in POINTS]
    np.testing.assert_array_equal(found < 0.0, inside)
    surface = _prism_surface(a, -1.0, 1.5)
    nearest = np.array([np.sqrt(((surface - p) ** 2).sum(axis=1)).min() for p in POINTS])
    np.testing.assert_allclose(np.abs(found), nearest, atol=0.04)


def test_a_polygon_without_heights_has_no_end() -> None:
    zone = PolygonZone(L_SHAPE)
    assert zone.distance(np.array([[-1.0, 1.0, 1e6]]))[0] == pytest.approx(-1.0)
    assert zone.distance(np.array([[3.0, -1.0, -1e6]]))[0] == pytest.approx(1.0)


def test_a_box_is_the_prism_over_its_base() -> None:
    box = BoxZone((-1.0, -2.0, -0.5), (2.0, 1.0, 3.0))
    base = PolygonZone(((-1.0, -2.0), (2.0, -2.0), (2.0, 1.0), (-1.0, 1.0)), (-0.5, 3.0))
    np.testing.assert_allclose(box.distance(POINTS), base.distance(POINTS), atol=1e-12)


def test_a_half_space() -> None:
    zone = HalfSpaceZone((0.0, 0.6, 0.8), 0.5)
    np.testing.assert_allclose(zone.distance(POINTS), 0.6 * POINTS[:, 1] + 0.8 * POINTS[:, 2] - 0.5)
