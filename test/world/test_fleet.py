"""Tests of the hall: objects stay in the aisles, move plausibly, and collide now and then."""

from itertools import pairwise

import numpy as np
import pytest

from collision_monitor.world import make_scene
from collision_monitor.world.fleet import CORNER, PITCH


@pytest.fixture(scope="module")
def a_minute():
    """A hall of 60 moving objects, and its states over 60 s, every 0.1 s."""
    scene = make_scene("fleet", objects=60, seed=4)
    return scene, [scene.states(), *(scene.step(0.1) for _ in range(600))]


def test_names_say_what_they_are():
    names = [d.name for d in make_scene("fleet", objects=5).descriptions]
    assert names[:5] == ["robot_1", "robot_2", "robot_3", "person_1", "person_2"]
    assert names[5:9] == ["wall_west", "wall_east", "wall_south", "wall_north"]


def test_nobody_leaves_the_hall(a_minute):
    scene, history = a_minute
    walls = {d.name: d for d in scene.descriptions if d.name.startswith("wall")}
    inner = {
        "low": [walls["wall_west"].pose.position[0] + 0.1, walls["wall_south"].pose.position[1] + 0.1],
        "high": [walls["wall_east"].pose.position[0] - 0.1, walls["wall_north"].pose.position[1] - 0.1],
    }
    for states in history:
        assert (states["position"][:, :2] > inner["low"]).all()
        assert (states["position"][:, :2] < inner["high"]).all()


def test_robots_and_people_keep_out_of_the_racks(a_minute):
    scene, history = a_minute
    racks = [d for d in scene.descriptions if d.name.startswith(("rack", "pillar"))]
    assert racks
    centre = np.array([d.pose.position[:2] for d in racks])
    half = np.array([d.shapes[0][0].size[:2] for d in racks]) / 2
    footprint = np.array([[0.6, 0.4], [0.6, -0.4], [-0.6, 0.4], [-0.6, -0.4]])  # of the largest robot
    for states in history:
        robots, people = states[:30], states[30:]
        sin, cos = 2 * robots["quaternion"][:, 2] * robots["quaternion"][:, 3], 1 - 2 * robots["quaternion"][:, 2] ** 2
        turn = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)
        corners = robots["position"][:, None, :2] + np.einsum("nij,cj->nci", turn, footprint)
        points = np.concatenate([corners.reshape(-1, 2), people["position"][:, :2]])
        assert not (np.abs(points[:, None] - centre) < half).all(axis=-1).any()


def test_robots_drive_along_their_heading_at_a_constant_speed(a_minute):
    _, history = a_minute
    for states in history:
        robots = states[:30]
        yaw = 2 * np.arctan2(robots["quaternion"][:, 2], robots["quaternion"][:, 3])
        speed = np.linalg.norm(robots["linear"], axis=1)
        assert np.isin(np.round(speed, 9), [0.9, 1.2, 1.5]).all()
        assert robots["linear"][:, 0] == pytest.approx(speed * np.cos(yaw), abs=1e-9)
        assert robots["linear"][:, 1] == pytest.approx(speed * np.sin(yaw), abs=1e-9)


def test_nobody_jumps(a_minute):
    _, history = a_minute
    for before, after in pairwise(history):
        way = np.linalg.norm(after["position"] - before["position"], axis=1)
        fastest = np.maximum(np.linalg.norm(before["linear"], axis=1), np.linalg.norm(after["linear"], axis=1))
        assert (way <= fastest * 0.1 + 1e-9).all()


def test_courses_stay_the_same_most_of_the_time(a_minute):
    _, history = a_minute
    same = [
        np.mean((after["linear"] == before["linear"]).all(axis=1) & (after["angular"] == 0).all(axis=1))
        for before, after in pairwise(history)
    ]
    assert np.mean(same) > 0.7


def test_people_and_robots_do_meet():
    scene = make_scene("fleet", objects=200)
    a, b = np.triu_indices(200, 1)
    met = set()
    for _ in range(300):
        xy = scene.step(0.1)["position"][:, :2]
        close = np.linalg.norm(xy[a] - xy[b], axis=1) < 0.5  # objects of any kind this near touch
        met |= {int(a[k] >= 100) + int(b[k] >= 100) for k in np.flatnonzero(close)}
    assert met == {0, 1, 2}  # robots with robots, robots with people, people with people


@pytest.mark.parametrize("objects", [100, 1000, 5000])
def test_the_hall_grows_with_its_objects(objects):
    scene = make_scene("fleet", objects=objects)
    west, east, south, north = (d.pose.position for d in scene.descriptions[objects : objects + 4])
    area = (east[0] - west[0]) * (north[1] - south[1])
    assert 0.5 < area / objects / (PITCH.prod() * 0.8) < 2.0
    assert west[0] < -CORNER
