"""Ground removal and voxels of clouds, against clouds whose ground is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import START, transforms
from foreign_messages import point_cloud
from scipy.spatial.transform import Rotation

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.sources.messages.ground_points import above_ground, ground_plane


def scene(seed: int, slope: float, count: int = 6000) -> tuple[Any, Any, Any]:
    """Points of a sloping ground with 1 cm of noise and of boxes on it, the mask of the ground, and its normal."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_euler("zx", [rng.uniform(0, 360), slope], degrees=True)
    ground = np.column_stack([rng.uniform(-8, 8, (count, 2)), rng.normal(0, 0.01, count).clip(-0.04, 0.04)])
    boxes = rng.uniform(-7, 7, (5, 1, 2)) + rng.uniform(-0.5, 0.5, (5, count // 10, 2))
    heights = rng.uniform(0.3, 1.8, (5, count // 10, 1))
    objects = np.concatenate([boxes, heights], axis=2).reshape(-1, 3)
    points = np.concatenate([ground, objects])
    return turn.apply(points), np.arange(len(points)) < count, turn.apply([0, 0, 1])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("slope", [0.0, 4.0, 9.0])
def test_a_ground_of_a_slope_up_to_the_stated_one_is_left_out(slope: float, seed: int) -> None:
    points, is_ground, normal = scene(seed, slope)
    plane = ground_plane(points, 10.0, 0.1)
    assert plane is not None and plane[0] @ normal > np.cos(np.radians(0.3)) and abs(plane[1]) < 0.02
    np.testing.assert_array_equal(above_ground(points, (-9.0, 9.0), 10.0, 0.1), ~is_ground)


def test_a_plane_that_is_too_steep_or_holds_few_points_is_no_ground() -> None:
    points, _, _ = scene(1, 30.0)
    assert above_ground(points, (-99.0, 99.0), 10.0, 0.02).mean() > 0.7
    assert ground_plane(np.random.default_rng(2).uniform(-5, 5, (4000, 3)), 5.0, 0.01) is None
    assert ground_plane(np.zeros((2, 3)), 5.0, 0.1) is None
    assert ground_plane(np.zeros((50, 3)), 5.0, 0.1) is None  # of one place


def last_shape(fed: Fed) -> Any:
    change = fed.changes[-1]
    assert isinstance(change, ObjectDescription)
    ((shape, _),) = change.shapes
    return shape


def test_a_cloud_is_voxels_of_what_is_in_a_band_of_heights_of_a_frame() -> None:
    points = [(1.0, 0.0, 0.02), (1.04, 0.03, 0.5), (1.06, 0.01, 0.52), (3.0, 0.0, 2.5), (-1.0, -1.0, 1.0)]
    entry = {"topic": "/points", "voxels": True, "voxel": 0.1, "frame": "floor", "min_height": 0.1, "max_height": 2.0}
    fed = Fed({"scan": entry})
    fed.give("/tf_static", START, transforms(START, ("map", "floor", (0, 0, -3), (0, 0, 0, 1))))
    fed.give("/tf_static", START, transforms(START, ("map", "lidar", (0, 0, -2), (0, 0, 0, 1))))
    fed.give("/points", START, point_cloud("lidar", START, np.subtract(points, (0, 0, 1.0))))
    assert last_shape(fed).cells.tolist() == [[10, 0, -5], [-10, -10, 0]]
    assert not fed.refused
    fed.give("/points", START + 1, point_cloud("lidar", START + 1, [(1.0, 0.0, -0.99)]))
    assert not isinstance(fed.changes[-1], ObjectDescription)  # nothing but ground


def test_keys_that_do_not_fit_and_an_unknown_frame_are_refused() -> None:
    for keys, text in (
        ({"voxels": True}, "scan, voxel: expected the edge of the voxels in m, got none"),
        ({"ground_slope": 95}, "scan, ground_slope: expected less than 90 deg, got 95"),
    ):
        (problem,) = (
            Fed({"scan": {"topic": "/points", **keys}}).feed.bind("/points", "sensor_msgs/msg/PointCloud2").values()
        )
        assert text in problem
    (problem,) = Fed({"scan": {"topic": "/s", "voxels": True}}).feed.bind("/s", "sensor_msgs/msg/LaserScan").values()
    assert "scan, voxels: sensor_msgs/msg/LaserScan does not use it" in problem
    fed = Fed({"scan": {"topic": "/points", "frame": "floor", "min_height": 0.1}})
    fed.give("/points", START, point_cloud("map", START, [(1, 0, 1)]))
    assert not fed.changes and any("floor" in text for text in fed.refused)


def test_a_map_that_grows_beyond_the_bound_is_refused_and_the_last_one_stays() -> None:
    fed = Fed({"scan": {"topic": "/points", "voxels": True, "voxel": 1e-6}})
    fed.give("/points", START, point_cloud("map", START, [(0, 0, 1)]))
    fed.give("/points", START + 1, point_cloud("map", START + 1, [(0, 0, 1), (90, 0, 1)]))
    assert len(fed.changes) == 1 and any("less than 131072 cells along each axis" in text for text in fed.refused)
