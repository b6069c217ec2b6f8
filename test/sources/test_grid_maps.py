"""Grid maps: heights at the places where grid_map has them, against its definition of a cell's position."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import START, odometry, transforms
from foreign_messages import grid_map

from collision_monitor.objects.description import ObjectDescription

MAP = {"ground": {"topic": "/elevation"}}


@pytest.mark.parametrize("start", [(0, 0), (2, 5), (3, 1)])
def test_each_height_is_at_the_centre_of_its_cell(start: Any) -> None:
    rng, rows, columns, edge, at = np.random.default_rng(1), 5, 7, 0.5, (10.0, 20.0, 1.0)
    heights = rng.random((rows, columns)).astype(np.float32)
    fed = Fed(MAP)
    layers = {"other": 0 * heights, "elevation": heights}
    fed.give("/elevation", START, grid_map("map", START, layers, edge, at, start))
    (change,) = fed.changes
    assert isinstance(change, ObjectDescription) and change.pose is not None and not fed.refused
    ((field, _),) = change.shapes
    for i in range(rows):
        for j in range(columns):  # the position of cell (i, j), as grid_map defines it
            x = at[0] + 0.5 * rows * edge - (i + 0.5) * edge
            y = at[1] + 0.5 * columns * edge - (j + 0.5) * edge
            column, row = (np.array([x, y]) - change.pose.position[:2]) / edge
            assert abs(column - round(column)) < 1e-9 and abs(row - round(row)) < 1e-9
            assert field.heights[round(row), round(column)] == heights[i, j]
    assert change.pose.position[2] == 1.0


def test_unknown_heights_are_unresolved_by_default() -> None:
    heights = np.ones((4, 4))
    heights[1, 1], heights[2, 2] = np.nan, np.inf
    fed = Fed(MAP)
    fed.give("/elevation", START, grid_map("map", START, {"elevation": heights}, 0.5, (0, 0, 0)))
    ((field, _),) = fed.changes[0].shapes  # type: ignore[union-attr]
    assert np.isnan(field.heights).sum() == 2
    assert [solid.unsure for solid in field.solids] == [False, True]


def test_a_terrain_that_comes_before_its_frame_waits_for_it() -> None:
    fed = Fed({**MAP, "cart": {"topic": "/odom", "shape": {"sphere": 1.0}}})
    fed.give("/elevation", START, grid_map("floor", START, {"elevation": np.ones((4, 4))}, 0.5, (0, 0, 0)))
    before = [change.object_id for change in fed.changes]
    fed.give("/tf_static", START + 1, transforms(START + 1, ("map", "floor", (5, 0, 1), (0, 0, 0, 1))))
    fed.give("/odom", START + 2, odometry("map", START + 2, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0)))
    (terrain,) = [each for each in fed.changes if isinstance(each, ObjectDescription) and each.name == "ground"]
    assert terrain.object_id not in before and terrain.pose is not None
    np.testing.assert_allclose(terrain.pose.position, (5 - 0.75, -0.75, 1))  # the centre of the last cell


def _set_layout(message: Any) -> None:
    message.data[0].layout.dim[0].label = "rows"


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda m: setattr(m, "layers", ["slope"]), "layers: expected 'elevation' and data of each, got slope"),
        (_set_layout, "layout: expected the dimensions column_index, row_index, got rows, row_index"),
        (lambda m: setattr(m.data[0].layout.dim[0], "size", 5), "data: expected 20 heights for 4 x 5, got 16"),
        (lambda m: setattr(m.data[0].layout.dim[0], "size", 1 << 30), "layout: expected 2 x 2 to 250000 cells"),
        (lambda m: setattr(m, "outer_start_index", 4), "start index: expected less than 4, 4, got 4, 0"),
        (lambda m: setattr(m.info, "resolution", math.nan), "HeightField resolution: expected a positive number"),
        (lambda m: setattr(m.info.pose.position, "x", math.inf), "position"),
    ],
)
def test_a_grid_map_that_cannot_be_used_is_refused(change: Any, text: str) -> None:
    kind, message = grid_map("map", START, {"elevation": np.ones((4, 4))}, 0.5, (0, 0, 0))
    change(message)
    fed = Fed(MAP)
    fed.give("/elevation", START, (kind, message))
    assert not fed.changes and any(text in each for each in fed.refused), list(fed.refused)
