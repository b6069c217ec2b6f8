"""Robots and people in a warehouse hall.

The hall is a grid of crossing aisles with racks between them; its size grows with the number of objects. A robot keeps
to the right-hand lane of its aisle, and goes straight on at a crossing or takes a quarter arc to the left or right. A
person walks straight from a point in one crossing to a point in the next. There are no right-of-way rules, so that
collisions occur.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import Pose, from_rotation_vector
from collision_monitor.shapes.registry import Box, Capsule, Cylinder
from collision_monitor.world.scene import Array, Scene, States, object_count, positive_rate, state_array

Integers = NDArray[np.int64]

ROBOT, PERSON, BUILDING = 1, 2, 4
"""Collision groups."""

PITCH = np.array([10.0, 6.0])
"""Distance (m) between crossings along x and along y."""
AISLE = 3.0
"""Width (m) of an aisle with two lanes."""
LANE_OFFSET = AISLE / 4
"""Offset (m) of a lane from the middle of the aisle."""
CORNER = AISLE / 2
"""Distance (m) of a rack's corner, the centre of an arc, from the middles of both aisles."""
CROSSINGS_PER_OBJECT = 0.8
OPEN_BLOCKS = 0.15
"""Fraction of the blocks with pillars at the corners instead of a rack."""
WALL_THICKNESS, WALL_HEIGHT, RACK_HEIGHT, PILLAR = 0.2, 4.0, 2.4, 0.4

HEADINGS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
"""Headings 0..3 as steps on the grid, counter-clockwise."""
STRAIGHT, LEFT, RIGHT = 0, 1, -1

PERSON_RADIUS, PERSON_HEIGHT = 0.25, 1.75


def _robot_shapes(kind: int) -> list[tuple[Box | Cylinder, Pose]]:
    """Shapes of the three kinds of robot, on z = 0 of their frame: cart, tug with a mast, round carrier with a load."""
    if kind == 0:
        return [(Box((1.0, 0.7, 0.4)), Pose((0.0, 0.0, 0.2)))]
    if kind == 1:
        mast = (Box((0.15, 0.6, 1.6)), Pose((0.45, 0.0, 1.1)))
        return [(Box((1.2, 0.8, 0.3)), Pose((0.0, 0.0, 0.15))), mast]
    return [(Cylinder(0.35, 0.3), Pose((0.0, 0.0, 0.15))), (Box((0.8, 0.6, 0.9)), Pose((0.0, 0.0, 0.75)))]


class Fleet(Scene):
    """Scene "fleet": half robots, half people; ids 1..n for the moving objects, followed by the building."""

    def __init__(self, objects: int | None, seed: int, rate: float | None) -> None:
        self.name = "fleet"
        self.rate = positive_rate(rate, 50.0)
        count = object_count(objects, 60, 2, 100_000, self.name)
        self._random = np.random.default_rng(seed)

        crossings = max(4, round(count * CROSSINGS_PER_OBJECT))
        columns = max(2, round(float(np.sqrt(crossings * PITCH[1] / PITCH[0]))))
        self._grid = np.array([columns, max(2, -(-crossings // columns))])

        robots = (count + 1) // 2
        self._ids = np.arange(1, count + 1, dtype=np.uint32)
        self._start_robots(robots)
        self._start_people(count - robots)
        self.descriptions = self._describe(robots, count)

    # -- robots: a tile is a crossing with half of each adjacent aisle

    def _start_robots(self, count: int) -> None:
        """Place each robot on its own lane, before the crossing of its tile."""
        node = np.stack(np.meshgrid(*map(np.arange, self._grid), indexing="ij"), axis=-1).reshape(-1, 2)
        node, heading = np.repeat(node, 4, axis=0), np.tile(np.arange(4), len(node))
        lanes = np.flatnonzero(self._inside(node - HEADINGS[heading]))
        chosen = self._random.permutation(lanes)[:count]
        self._node, self._heading = node[chosen], heading[chosen]
        self._speed = self._random.choice([0.9, 1.2, 1.5], count)
        self._turn = self._choose_turn(self._node, self._heading)
        lead_in = self._tile_path(slice(None))[0]
        self._travelled = lead_in * self._random.random(count)

    def _inside(self, node: Integers) -> NDArray[np.bool_]:
        inside: NDArray[np.bool_] = np.logical_and.reduce((node >= 0) & (node < self._grid), axis=-1)
        return inside

    def _choose_turn(self, node: Integers, heading: Integers) -> Integers:
        """Choose a turn that stays in the hall; one always exists, as the grid has two rows and two columns or more."""
        turns = np.array([STRAIGHT, STRAIGHT, LEFT, RIGHT])  # straight on is twice as likely
        open_ = self._inside(node[:, None] + HEADINGS[(heading[:, None] + turns) % 4])
        score = np.where(open_, self._random.random(open_.shape), -1.0)
        chosen: Integers = turns[score.argmax(axis=1)]
        return chosen

    def _tile_path(self, which: NDArray[np.intp] | slice) -> tuple[Array, Array, Array]:
        """Lengths (m) of the path through the tile: before the crossing, through it, and after it."""
        heading, turn = self._heading[which], self._turn[which]
        lead_in = PITCH[heading % 2] / 2 - CORNER
        lead_out = PITCH[(heading + turn) % 2] / 2 - CORNER
        through = np.where(turn == STRAIGHT, 2 * CORNER, (CORNER + turn * LANE_OFFSET) * np.pi / 2)
        return lead_in, through, lead_out

    def _advance_robots(self, dt: float) -> None:
        self._travelled += self._speed * dt
        left = np.arange(len(self._travelled))
        while True:
            length = np.sum(self._tile_path(left), axis=0)
            done = self._travelled[left] >= length
            if not done.any():
                return
            left, length = left[done], length[done]
            self._travelled[left] -= length
            self._heading[left] = (self._heading[left] + self._turn[left]) % 4
            self._node[left] += HEADINGS[self._heading[left]]
            self._turn[left] = self._choose_turn(self._node[left], self._heading[left])

    def _write_robots(self, states: States) -> None:
        """Write poses and twists: computed along (u) and left (v) of the heading, then rotated to the hall's axes."""
        lead_in, through, _ = self._tile_path(slice(None))
        radius = CORNER + self._turn * LANE_OFFSET
        before = np.minimum(self._travelled - lead_in, 0.0)
        inside = np.clip(self._travelled - lead_in, 0.0, through)
        after = np.maximum(self._travelled - lead_in - through, 0.0)

        turning = self._turn != STRAIGHT
        angle = np.where(turning, self._turn * inside / radius, 0.0)
        u = before - CORNER + np.where(turning, radius * np.sin(np.abs(angle)), inside) + after * np.cos(angle)
        v = -LANE_OFFSET + self._turn * radius * (1.0 - np.cos(angle)) + after * np.sin(angle)

        yaw = self._heading * (np.pi / 2)
        along = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        leftward = np.stack([-along[:, 1], along[:, 0]], axis=1)
        states["position"][:, :2] = self._node * PITCH + u[:, None] * along + v[:, None] * leftward
        yaw = yaw + angle
        states["quaternion"] = from_rotation_vector(yaw[:, None] * np.array([0.0, 0.0, 1.0]))
        states["linear"][:, 0] = self._speed * np.cos(yaw)
        states["linear"][:, 1] = self._speed * np.sin(yaw)
        in_arc = turning & (before == 0.0) & (after == 0.0)
        states["angular"][:, 2] = np.where(in_arc, self._turn * self._speed / radius, 0.0)

    # -- people: straight paths between points in neighbouring crossings, so that they stay in the aisle

    def _start_people(self, count: int) -> None:
        self._goal_node = self._random.integers(0, self._grid, (count, 2))
        self._from = np.empty((count, 2))
        self._to = self._point_in_crossing(self._goal_node)
        self._pace = self._random.uniform(0.8, 1.6, count)
        self._walked = np.zeros(count)
        self._length = np.zeros(count)
        self._walk_on(np.arange(count))
        self._walked = self._length * self._random.random(count)

    def _point_in_crossing(self, node: Integers) -> Array:
        room = CORNER - 0.9 * PERSON_RADIUS  # slightly more than free of the racks, so that some people brush one
        point: Array = node * PITCH + self._random.uniform(-room, room, node.shape)
        return point

    def _walk_on(self, walkers: NDArray[np.intp]) -> None:
        """Give people at their goal a new goal in a neighbouring crossing."""
        next_node = self._goal_node[walkers][:, None] + HEADINGS
        score = np.where(self._inside(next_node), self._random.random(next_node.shape[:2]), -1.0)
        self._goal_node[walkers] = next_node[np.arange(len(walkers)), score.argmax(axis=1)]
        self._from[walkers] = self._to[walkers]
        self._to[walkers] = self._point_in_crossing(self._goal_node[walkers])
        self._length[walkers] = np.linalg.norm(self._to[walkers] - self._from[walkers], axis=1)

    def _advance_people(self, dt: float) -> None:
        self._walked += self._pace * dt
        while len(there := np.flatnonzero(self._walked >= self._length)):
            self._walked[there] -= self._length[there]
            self._walk_on(there)

    def _write_people(self, states: States) -> None:
        direction = (self._to - self._from) / self._length[:, None]
        states["position"][:, :2] = self._from + direction * self._walked[:, None]
        states["position"][:, 2] = PERSON_HEIGHT / 2
        states["linear"][:, :2] = direction * self._pace[:, None]

    # -- the scene

    def _advance(self, dt: float) -> None:
        self._advance_robots(dt)
        self._advance_people(dt)

    def states(self) -> States:
        """Return the current states. See Scene."""
        states = state_array(self._ids)
        robots = len(self._node)
        self._write_robots(states[:robots])
        self._write_people(states[robots:])
        return states

    def _describe(self, robots: int, count: int) -> list[ObjectDescription]:
        person = Capsule(PERSON_RADIUS, PERSON_HEIGHT - 2 * PERSON_RADIUS)
        kinds = [_robot_shapes(kind) for kind in range(3)]
        found = [ObjectDescription(i + 1, kinds[i % 3], f"robot_{i + 1}", group=ROBOT) for i in range(robots)]
        found += [
            ObjectDescription(i + 1, person, f"person_{i + 1 - robots}", group=PERSON) for i in range(robots, count)
        ]
        for name, size, centre in self._building():
            pose = Pose((*centre, size[2] / 2))
            found.append(ObjectDescription(len(found) + 1, Box(size), name, static=True, pose=pose, group=BUILDING))
        return found

    def _building(self) -> list[tuple[str, tuple[float, float, float], tuple[float, float]]]:
        """Name, size and centre on the floor (m) of the walls, the racks and the pillars."""
        low, high = np.full(2, -CORNER), (self._grid - 1) * PITCH + CORNER
        middle, extent = (low + high) / 2, high - low + 2 * WALL_THICKNESS
        t, h = WALL_THICKNESS, WALL_HEIGHT
        parts = [
            ("wall_west", (t, extent[1], h), (low[0] - t / 2, middle[1])),
            ("wall_east", (t, extent[1], h), (high[0] + t / 2, middle[1])),
            ("wall_south", (extent[0], t, h), (middle[0], low[1] - t / 2)),
            ("wall_north", (extent[0], t, h), (middle[0], high[1] + t / 2)),
        ]
        rack = PITCH - AISLE
        racks = pillars = 0
        for column in range(self._grid[0] - 1):
            for row in range(self._grid[1] - 1):
                centre = (np.array([column, row]) + 0.5) * PITCH
                if self._random.random() >= OPEN_BLOCKS:
                    racks += 1
                    parts.append((f"rack_{racks}", (*rack, RACK_HEIGHT), tuple(centre)))
                    continue
                for corner in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
                    pillars += 1
                    spot = centre + np.array(corner) * (rack - PILLAR) / 2
                    parts.append((f"pillar_{pillars}", (PILLAR, PILLAR, WALL_HEIGHT), tuple(spot)))
        return parts
