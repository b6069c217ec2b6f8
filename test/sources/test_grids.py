"""Maps of cells: from the bytes of OccupancyGrid, Costmap and their updates to the objects of the monitor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import START, odometry, transforms
from foreign_messages import costmap, costmap_update, occupancy_grid, occupancy_update
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.codec import Removal
from collision_monitor.objects.description import ObjectDescription

CELLS = np.array([[0, 100, -1, 64], [65, 0, 0, 0], [0, 0, 100, -1]])
MAP = {"map": {"topic": "/map", "updates": "/map_updates", "height": 1.5}}


def last(fed: Fed, name: str) -> Any:
    """The last description of an object; None if it was removed since."""
    found, numbers = None, set()
    for change in fed.changes:
        if isinstance(change, ObjectDescription) and change.name == name:
            found = change
            numbers.add(change.object_id)
        elif isinstance(change, Removal) and change.object_id in numbers:
            found = None
    return found


def grid_of(fed: Fed, name: str = "map") -> Any:
    ((grid, _),) = last(fed, name).shapes
    return grid


def test_occupied_and_unknown_cells_are_two_objects_at_the_origin_of_the_map() -> None:
    fed = Fed(MAP)
    turned = Rotation.from_euler("z", 0.5).as_quat()
    fed.give("/tf_static", START, transforms(START, ("map", "floor", (5, 0, 1), (0, 0, 0, 1))))
    fed.give("/map", START, occupancy_grid("floor", START, CELLS, 0.5, (1, 2, 0), turned))
    np.testing.assert_array_equal(grid_of(fed).cells == 1, CELLS >= 65)
    assert not (grid_of(fed).cells == 2).any()
    np.testing.assert_array_equal(grid_of(fed, "map/unknown").cells == 2, CELLS < 0)
    assert (grid_of(fed).resolution, grid_of(fed).height) == (0.5, 1.5)
    for name in ("map", "map/unknown"):
        at = last(fed, name)
        assert at.static
        np.testing.assert_allclose(at.pose.position, (6, 2, 1))
        np.testing.assert_allclose(at.pose.quaternion, turned)
    assert not fed.refused


@pytest.mark.parametrize(("unknown", "filled"), [("obstacle", CELLS < 0), ("free", np.zeros((3, 4), bool))])
def test_unknown_cells_are_what_the_file_says(unknown: str, filled: Any) -> None:
    fed = Fed({"map": {**MAP["map"], "unknown": unknown, "threshold": 60}})
    fed.give("/map", START, occupancy_grid("map", START, CELLS))
    np.testing.assert_array_equal(grid_of(fed).cells == 1, (CELLS >= 60) | filled)
    assert last(fed, "map/unknown") is None


def test_updates_change_the_cells_of_both_objects() -> None:
    fed, cells, rng = Fed(MAP), np.full((90, 150), 0), np.random.default_rng(3)
    cells[:4] = 100
    fed.give("/map", START, occupancy_grid("map", START, cells))
    assert last(fed, "map/unknown") is None
    for k in range(1, 12):
        rows, columns = rng.integers(1, 40, 2)
        row, column = rng.integers(0, 90 - rows), rng.integers(0, 150 - columns)
        part = rng.choice([-1, 0, 100], (rows, columns), p=[0.2, 0.6, 0.2])
        cells[row : row + rows, column : column + columns] = part
        fed.give("/map_updates", START + k, occupancy_update("map", START + k, row, column, part))
        np.testing.assert_array_equal(grid_of(fed).cells == 1, cells > 0)
        np.testing.assert_array_equal(grid_of(fed, "map/unknown").cells == 2, cells < 0)
    fed.give("/map_updates", START + 20, occupancy_update("map", START + 20, 0, 0, 0 * cells))
    assert last(fed, "map") is None and last(fed, "map/unknown") is None
    fed.give("/map_updates", START + 21, occupancy_update("map", START + 21, 3, 5, [[100]]))
    assert np.argwhere(grid_of(fed).cells).tolist() == [[3, 5]]
    assert not fed.refused


def test_costs_count_from_the_lethal_one_on() -> None:
    fed, cells = Fed({"costs": {"topic": "/costs", "updates": "/more"}}), np.array([[0, 253, 254], [255, 0, 1]])
    fed.give("/costs", START, costmap("map", START, cells))
    assert np.argwhere(grid_of(fed, "costs").cells).tolist() == [[0, 2]]
    assert np.argwhere(grid_of(fed, "costs/unknown").cells).tolist() == [[1, 0]]
    fed.give("/more", START + 1, costmap_update("map", START + 1, 1, 1, [[254, 255]]))
    assert np.argwhere(grid_of(fed, "costs").cells).tolist() == [[0, 2], [1, 1]]
    assert np.argwhere(grid_of(fed, "costs/unknown").cells).tolist() == [[1, 0], [1, 2]]
    assert not fed.refused


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda m: setattr(m.info, "resolution", 0.0), "resolution: expected a positive number of metres, got 0"),
        (lambda m: setattr(m.info, "resolution", math.nan), "resolution: expected a positive number"),
        (lambda m: setattr(m.info, "width", 5), "data: expected 15 cells for 5 x 3, got 12"),
        (lambda m: setattr(m.info, "width", 0), "expected 1 to 25000000 cells, got 0 x 3"),
        (lambda m: (setattr(m.info, "width", 31623), setattr(m.info, "height", 31623)), "got 31623 x 31623"),
        (lambda m: setattr(m.info.origin.position, "x", math.nan), "position"),
        (lambda m: setattr(m.info.origin.position, "x", 1e30), "position"),
        (lambda m: setattr(m.info.origin.orientation, "w", 7.0), "quaternion"),
        (lambda m: setattr(m.header, "frame_id", "nowhere"), "nowhere"),
    ],
)
def test_a_map_that_cannot_be_used_leaves_the_last_one(change: Any, text: str) -> None:
    fed = Fed(MAP)
    fed.give("/map", START, occupancy_grid("map", START, CELLS))
    before = len(fed.changes)
    kind, message = occupancy_grid("map", START + 1, CELLS)
    change(message)
    fed.give("/map", START + 1, (kind, message))
    assert len(fed.changes) == before
    assert any(text in each for each in fed.refused), list(fed.refused)
    fed.give("/map_updates", START + 2, occupancy_update("map", START + 2, 0, 0, [[100]]))
    assert grid_of(fed).cells[0, 0] == 1


@pytest.mark.parametrize(
    ("row", "column", "frame", "text"),
    [
        (2, 3, "map", "update: expected cells within 4 x 3, got 2 x 2 from 3, 2 on"),
        (-1, 0, "map", "from 0, -1 on"),
        (0, 0, "odom", "no transform from 'map' to 'odom'"),
    ],
)
def test_an_update_outside_of_the_map_is_left_out(row: int, column: int, frame: str, text: str) -> None:
    fed = Fed(MAP)
    fed.give("/map", START, occupancy_grid("map", START, CELLS))
    before = len(fed.changes)
    fed.give("/map_updates", START, occupancy_update(frame, START, row, column, [[100, 100], [100, 100]]))
    assert len(fed.changes) == before and any(text in each for each in fed.refused), list(fed.refused)


def test_a_map_that_comes_before_its_frame_waits_for_it() -> None:
    fed = Fed({**MAP, "cart": {"topic": "/odom", "shape": {"sphere": 1.0}}})
    fed.give("/map", START, occupancy_grid("floor", START, CELLS))
    assert last(fed, "map") is None
    fed.give("/tf_static", START + 1, transforms(START + 1, ("map", "floor", (5, 0, 1), (0, 0, 0, 1))))
    fed.give("/odom", START + 2, odometry("map", START + 2, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0)))
    np.testing.assert_allclose(last(fed, "map").pose.position, (5, 0, 1))


def test_an_update_before_the_map_and_keys_of_others_are_refused() -> None:
    fed = Fed(MAP)
    fed.give("/map_updates", START, occupancy_update("map", START, 0, 0, [[100]]))
    assert not fed.changes
    fed = Fed({"map": {"topic": "/map", "radius": 1.0}})
    (problem,) = fed.feed.bind("/map", "nav_msgs/msg/OccupancyGrid").values()
    assert "map, radius: nav_msgs/msg/OccupancyGrid does not use it; it uses allowed, group, height" in problem
    with pytest.raises(cm.InputError, match="map, unknown: 'solid' is unknown"):
        Fed({"map": {"topic": "/map", "unknown": "solid"}})
