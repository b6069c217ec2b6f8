"""Scenes of bodies that respond to each other: laws of motion, rest, penetration, options, and bad input."""

from math import cos, sin

import numpy as np
import pytest

from collision_monitor.errors import InputError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.world import make_scene
from collision_monitor.world.rigid.impulse_response import ImpulseResponse
from collision_monitor.world.rigid.penalty_response import PenaltyResponse
from collision_monitor.world.rigid.response_choice import METHODS
from collision_monitor.world.rigid.rigid_bodies import RigidBodies
from collision_monitor.world.rigid.stick_response import StickResponse
from collision_monitor.world.slope import ANGLE

SCENES = ("billiards", "slope", "pile", "pendulums")


def bodies(moving, static=(), friction=0.5, velocity=None):
    """Bodies of (shape, position), moving and static."""
    shapes, places = zip(*moving, *static, strict=True)
    still = np.arange(len(shapes)) >= len(moving)
    turned = np.tile([0.0, 0.0, 0.0, 1.0], (len(shapes), 1))
    world = RigidBodies(shapes, np.array(places, float), turned, still, np.full(len(shapes), friction))
    if velocity is not None:
        world.velocity[: len(moving)] = velocity
    return world


GROUND = [(Box((20, 20, 1)), (0, 0, -0.5))]


def test_a_stack_of_ten_boxes_neither_sinks_nor_jitters():
    """Four seconds here; benchmarks/responses.py runs a minute."""
    world = bodies([(Box((1, 1, 1)), (0.02 * (-1) ** i, 0.01 * (i % 3), 0.5 + i)) for i in range(10)], GROUND)
    start, response = world.position.copy(), ImpulseResponse(0.3, 9.81)
    for _ in range(300):
        response.advance(world, 1 / 100)
    assert np.abs(world.position - start).max() < 1e-4
    settled = world.position.copy()
    for _ in range(100):
        response.advance(world, 1 / 100)
        assert np.abs(world.velocity).max() < 1e-6
    assert np.abs(world.position - settled).max() < 1e-6


@pytest.mark.parametrize("shape", [Sphere(0.1), Box((0.2, 0.2, 0.2))])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
def test_a_dropped_body_bounces_to_the_height_of_its_restitution(shape, restitution):
    world = bodies([(shape, (0, 0, 1.1))], GROUND)
    response, height = ImpulseResponse(restitution, 9.81), []
    for _ in range(1000):
        response.advance(world, 1e-3)
        height.append(world.position[0, 2] - 0.1)
    first = int(np.argmax(np.diff(height) > 0.0)) if restitution else 600
    assert max(height[first:]) == pytest.approx(restitution**2, abs=3e-3)


def test_a_glancing_hit_of_two_balls_is_the_exact_one():
    """Two balls of 0.1 m offset by 0.12 m; the normal at contact makes the angle asin(0.6)."""
    balls = [(Sphere(0.1), (-1, 0.12, 0)), (Sphere(0.1), (0, 0, 0))]
    world = bodies(balls, velocity=[(2, 0, 0), (0, 0, 0)], friction=0)
    response = ImpulseResponse(1.0, 0.0)
    for _ in range(100):
        response.advance(world, 0.01)
    n = np.array([0.8, -0.6, 0])
    expected = 2 * 0.8 * n
    assert world.velocity[1] == pytest.approx(expected, abs=1e-3)
    assert world.velocity[0] == pytest.approx(np.array([2, 0, 0]) - expected, abs=1e-3)
    assert (world.velocity**2).sum() == pytest.approx(4.0, rel=1e-12)


def test_a_thin_wall_stops_a_fast_ball():
    wall = [(Box((0.01, 4, 4)), (0.0, 0, 0))]
    world = bodies([(Sphere(0.05), (-5, 0, 0))], wall, velocity=[(500.0, 0, 0)])
    ImpulseResponse(1.0, 0.0).advance(world, 0.1)
    assert world.velocity[0] == pytest.approx([-500.0, 0, 0])
    assert world.position[0, 0] < 0


@pytest.mark.parametrize("friction", [0.2, 0.3, 0.43, 0.7])
def test_a_block_on_a_slope_slides_by_newtons_law_or_stays(friction):
    scene = make_scene("slope", objects=1)
    scene.world.friction[:] = friction
    start = scene.world.position[0].copy()
    for _ in range(100):
        scene.step()
    down = np.array([cos(ANGLE), 0, -sin(ANGLE)])
    acceleration = max(9.81 * (sin(ANGLE) - friction * cos(ANGLE)), 0.0)
    assert (scene.world.position[0] - start) @ down == pytest.approx(acceleration / 2, rel=0.01, abs=1e-4)


def test_a_ball_on_a_rough_slope_rolls_at_five_sevenths():
    scene = make_scene("slope", objects=3)
    scene.world.friction[:] = 0.6
    start = scene.world.position[2].copy()
    for _ in range(100):
        scene.step()
    moved = np.linalg.norm(scene.world.position[2] - start)
    assert moved == pytest.approx(5 / 7 * 9.81 * sin(ANGLE) / 2, rel=0.01)


def test_a_pile_comes_to_rest_without_penetration():
    scene = make_scene("pile", objects=10, seed=3)
    energies = []
    for _ in range(400):
        scene.step()
        energies.append(scene.energy)
    assert (np.diff(energies) <= 1e-3 * energies[0]).all()
    boxes = scene.world.box & scene.world.movable
    assert np.abs(scene.world.velocity[boxes]).max() < 1e-2
    assert scene.world.touching(0.0).gap.min() > -1e-3 * scene.world.size


def test_elastic_billiards_without_friction_keeps_its_energy():
    scene = make_scene("billiards", restitution=1.0, gravity=0.0)
    scene.world.friction[:] = 0.0
    start = scene.energy
    for _ in range(200):
        scene.step()
    assert scene.energy == pytest.approx(start, rel=1e-9)
    assert (np.linalg.norm(scene.world.velocity[:16], axis=1) > 1e-3).sum() > 10


def test_a_straight_shot_leaves_the_triangle_symmetric():
    scene = make_scene("billiards", gravity=0.0, restitution=0.9)
    scene.world.velocity[0] = (5.0, 0, 0)
    for _ in range(35):
        scene.step()
    position = scene.world.position[1:16]
    assert np.linalg.norm(scene.world.velocity[1:16], axis=1).max() > 1.0
    mirrored = np.array([1, -1, 1]) * position
    nearest = np.linalg.norm(position[:, None] - mirrored[None], axis=2).min(axis=1)
    assert nearest.max() < 1e-6


def test_a_cradle_passes_the_swing_on_and_keeps_its_energy():
    scene = make_scene("pendulums", objects=5, seed=2)
    scene.angle[:] = [-0.4, 0, 0, 0, 0]
    start = scene.energy
    for _ in range(70):  # half a period and a little
        scene.step()
    assert abs(scene.angle[:4]).max() < 0.01
    assert scene.angle[4] > 0.2
    for _ in range(150):
        scene.step()
    assert scene.energy == pytest.approx(start, rel=1e-4)


def test_bodies_that_stick_keep_momentum_and_angular_momentum():
    world = bodies([(Sphere(0.1), (-1, 0.12, 0)), (Sphere(0.1), (0, 0, 0))], velocity=[(2, 0, 0), (0, 0, 0)])
    mass, response = world.mass[0], StickResponse(0.0)
    for _ in range(200):
        response.advance(world, 0.01)
    assert world.velocity.sum(axis=0) == pytest.approx([2.0, 0, 0])
    spin = 0.4 * 0.01 * world.angular.sum(axis=0)
    centre = world.position.mean(axis=0)
    about = np.cross(world.position - centre, world.velocity).sum(axis=0) + spin
    assert about == pytest.approx([0, 0, -0.12], abs=1e-3)
    assert np.linalg.norm(world.position[1] - world.position[0]) == pytest.approx(0.2, abs=1e-5)
    assert mass == world.mass[1]


@pytest.mark.parametrize(("restitution", "kept"), [(1.0, 1.0), (0.7, 0.49)])
def test_springs_keep_the_energy_and_dampers_take_what_they_should(restitution, kept):
    world = bodies([(Sphere(0.1), (0, 0, 0)), (Sphere(0.1), (1, 0, 0))], velocity=[(1, 0, 0), (-1, 0, 0)], friction=0)
    response = PenaltyResponse(restitution, 0.0, 2.0)
    for _ in range(100):
        response.advance(world, 0.01)
    assert world.velocity[1, 0] > 0
    assert (world.velocity**2).sum() / 2 == pytest.approx(kept, abs=0.06 if kept < 1 else 0.01)


@pytest.mark.parametrize("response", METHODS)
@pytest.mark.parametrize("name", SCENES)
def test_every_scene_runs_with_every_response(name, response):
    scene = make_scene(name, objects=8, response=response, restitution=0.5)
    start = scene.energy
    for _ in range(30):
        states = scene.step()
    assert np.isfinite(states["position"]).all()
    assert scene.energy <= start + 0.01 * abs(start)


@pytest.mark.parametrize("name", SCENES)
def test_counts_seeds_and_bits(name):
    assert len(make_scene(name, objects=31).step()) == 31
    assert make_scene(name, seed=1).step(0.2).tobytes() != make_scene(name, seed=2).step(0.2).tobytes()
    for objects in (0, 501, 2.5, True):
        with pytest.raises(InputError, match=r"from [12] to 500"):
            make_scene(name, objects=objects)


def test_no_gravity_lets_everything_float():
    scene = make_scene("pile", gravity=0.0, objects=5)
    before = scene.states()["position"].copy()
    assert scene.step(1.0)["position"] == pytest.approx(before)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"restitution": 1.5}, "restitution: expected 0"),
        ({"restitution": float("nan")}, "restitution"),
        ({"gravity": -9.81}, "gravity: expected 0 to 1000"),
        ({"gravity": float("inf")}, "gravity"),
        ({"response": "magic"}, "response: expected one of impulse, penalty, damped, stick"),
    ],
)
def test_impossible_options_are_refused(options, text):
    with pytest.raises(InputError, match=text):
        make_scene("billiards", **options)
    with pytest.raises(InputError, match="expected one of the scenes billiards"):
        make_scene("fleet", **options)


def test_twists_and_accelerations_predict_the_next_state():
    """A monitor that trusts the states expects free bodies where they come to be."""
    scene = make_scene("pile", objects=12)
    scene.step(0.1)
    now = scene.states()
    after = scene.step(0.05)
    flying = (now["flags"] != 0) & (after["flags"] != 0)
    expected = now["position"] + 0.05 * now["linear"] + 0.00125 * now["acceleration"]
    assert flying.sum() > 5
    assert after["position"][flying] == pytest.approx(expected[flying], abs=1e-9)


def test_a_monitor_predicts_the_first_hit_of_the_cue_ball():
    scene = make_scene("billiards", seed=4)
    monitor = Monitor()
    for each in scene.descriptions:
        ((shape, _),) = each.shapes
        pose = each.pose if each.static else None
        monitor.add(each.object_id, shape, static=each.static, pose=pose, group=each.group, mask=each.mask)
    result = monitor.step(0, scene.states())
    hits = [p for p in result.predictions if 1 in (p["id_a"], p["id_b"])]
    first = min(hits, key=lambda p: p["lower"])
    time = 0.0
    while np.abs(scene.world.velocity[1:16]).max() < 0.1 and time < 2.0:
        scene.step(1e-3)
        time += 1e-3
    assert {int(first["id_a"]), int(first["id_b"])} <= set(range(1, 17))
    # friction on the table brakes the ball by 0.1 g for these 0.2 s, so it is later than its twist says
    assert first["lower"] - 1e-3 <= time <= first["upper"] + 0.01


def test_the_pose_of_a_static_body_is_where_it_was_put():
    scene = make_scene("slope")
    slope = next(each for each in scene.descriptions if each.name == "slope")
    assert isinstance(slope.pose, Pose)
    assert slope.static
