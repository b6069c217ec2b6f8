"""Robots as sources: joint states, bases, URDFs from topics, and what is refused, through the feed of the live node."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from foreign_bag import write_bag
from played_sources import JOINTS, MILLISECOND, START, TF, Played, base_row, check, transform, turned
from ros_messages import SECOND, definitions, header, message, pose, vector

from collision_monitor.errors import InputError
from collision_monitor.records import Model, StateFlag
from collision_monitor.robots.robot import Description, Robot
from collision_monitor.shapes.pose import multiply, rotation_matrix
from collision_monitor.sources import import_bag
from collision_monitor.sources.decoding import Decoder
from collision_monitor.sources.feed import Feed
from collision_monitor.sources.ground.mapping import load_mapping, make_mapping
from collision_monitor.sources.template import NOTHING, Seen, sources_file

ROOT = Path(__file__).parents[3]
ARM = ROOT / "examples/arm/arm.urdf"
MOBILE = ROOT / "test/robots/models/mobile_base.urdf"
ODOMETRY, STRING = "nav_msgs/msg/Odometry", "std_msgs/msg/String"
BOLTED: dict[str, Any] = {"urdf": str(ARM), "joint_states": "/joint_states", "base": {"pose": [1, 2, 0.5]}}


def arm() -> Robot:
    return Robot(Description.read(ARM))


def test_the_links_of_a_bolted_arm_move_with_its_joints() -> None:
    played, robot = Played(BOLTED), arm()
    assert [name for name, it in played.objects.items() if it.static] == ["arm/base"]
    assert played.objects["arm/base"].pose is not None
    assert played.objects["arm/base"].pose.position.tolist() == [1, 2, 0.5]
    position, velocity = np.linspace(-1, 1, 8), np.linspace(2, -2, 8)
    played.joints(START, position, velocity)
    assert len(played.states) == 10 and played.steps[-1].stamp_ns == START
    check(played, robot, np.column_stack([position, velocity]), base_row((1, 2, 0.5)))
    assert not played.refusals


def test_states_are_brought_to_the_stamp_of_the_step() -> None:
    played, robot = Played(BOLTED, rate=10), arm()
    position, velocity = np.linspace(-1, 1, 8), np.linspace(2, -2, 8)
    played.joints(START, position, velocity)
    played.joints(START + 170 * MILLISECOND, position, velocity)
    assert [step.stamp_ns for step in played.steps] == [START, START + 100 * MILLISECOND]
    moved = np.column_stack([position - 0.07 * velocity, velocity])
    check(played, robot, moved, base_row((1, 2, 0.5)), atol=1e-9)


def test_joints_may_come_in_several_messages_and_without_velocities() -> None:
    played, robot = Played(BOLTED), arm()
    played.joints(START, np.full(7, 0.1), np.ones(7), JOINTS[:7])
    assert "arm/hand" in played.states and "arm/left_finger" not in played.states
    assert any("expected positions of finger_joint on /joint_states" in text for text in played.refusals)
    played.joints(START + 10 * MILLISECOND, [0.02], (), ["finger_joint"])
    assert set(played.states) == {"arm/left_finger", "arm/right_finger"}
    assert all(state["flags"] & StateFlag.TWIST_UNKNOWN for state in played.states.values())
    played.joints(START + 20 * MILLISECOND, [0.021], (), ["finger_joint"])
    assert not any(state["flags"] & StateFlag.TWIST_UNKNOWN for state in played.states.values())
    joints = np.column_stack([[*np.full(7, 0.12), 0.021], [*np.ones(7), 0.1]])
    check(played, robot, joints, base_row((1, 2, 0.5)), atol=1e-9)


def test_a_continuous_joint_that_wraps_turns_on() -> None:
    played = Played({"urdf": str(MOBILE), "joint_states": "/joint_states", "base": {"pose": [0, 0, 0]}})
    names = ["left_wheel_joint"]
    played.joints(START, [3.1], (), names)
    played.joints(START + 100 * MILLISECOND, [-3.1], (), names)
    expected = (2 * np.pi - 6.2) / 0.1
    np.testing.assert_allclose(played.states["arm/left_wheel"]["angular"], (0, expected, 0), rtol=1e-9, atol=1e-12)


def test_links_of_a_joint_that_is_silent_are_left_out() -> None:
    played = Played(BOLTED, max_age=0.5)
    played.joints(START, np.zeros(8), np.zeros(8))
    for k in range(1, 7):
        played.joints(START + k * 100 * MILLISECOND, np.zeros(2), np.zeros(2), JOINTS[:2])
    assert set(played.states) == {"arm/shoulder", "arm/upper_arm"}
    assert any("joint_7, finger_joint on /joint_states not older than max_age" in text for text in played.refusals)


@pytest.mark.parametrize(
    ("position", "velocity", "names", "text"),
    [
        ([1, 2], [1], ["joint_1", "joint_2"], "for each of 2 joints, got 2 positions and 1 velocities"),
        ([1], [], ["joint_1", "joint_2"], "for each of 2 joints, got 1 positions and 0 velocities"),
        ([np.nan, 1], [], ["joint_1", "joint_2"], "expected finite positions, got others for joint_1"),
        ([1], [], ["joint_77"], "expected joints of its URDF on /joint_states, got 'joint_77'"),
    ],
)
def test_joint_states_that_cannot_be_used_are_counted(position: Any, velocity: Any, names: Any, text: str) -> None:
    played = Played(BOLTED)
    played.joints(START, position, velocity, names)
    played.joints(START + MILLISECOND, position, velocity, names)
    assert any(text in refusal for refusal in played.refusals), played.refusals
    played.joints(START + 2 * MILLISECOND, np.zeros(8), np.zeros(8))
    assert len(played.states) == 10


def odometry(stamp: int, base: Any, child: str, covariance: float = 0.0) -> Any:
    """Return an Odometry of this base row; its twist is along the axes of the child, as the message defines it."""
    R = rotation_matrix(base[3:7])
    twist = message("geometry_msgs/msg/Twist", linear=vector(*(R.T @ base[7:10])), angular=vector(*(R.T @ base[10:])))
    matrix = covariance * np.eye(6).ravel()
    return message(
        ODOMETRY,
        header=header("odom", stamp),
        child_frame_id=child,
        pose=message("geometry_msgs/msg/PoseWithCovariance", pose=pose(base[:3], base[3:7]), covariance=matrix),
        twist=message("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=matrix),
    )


def test_a_mobile_base_moves_with_odometry_of_a_link_in_another_frame() -> None:
    file = {"urdf": str(MOBILE), "joint_states": "/joint_states", "base": {"odometry": "/odom", "link": "laser"}}
    played = Played(file)
    turn = turned(0.1, -0.2, 0.7)
    played.send("/tf_static", TF, transform(START, "map", "odom", (10, 20, 30), turn))
    at_laser = base_row((1, 2, 3), turned(0.3, 0.1, -0.5), (0.4, 0.5, -0.6), (0.7, -0.8, 0.9))
    played.send("/odom", ODOMETRY, odometry(START, at_laser, "laser", 0.01), START)
    assert {"arm/base_link", "arm/mast", "arm/laser"} == set(played.states)
    R = rotation_matrix(turn)
    state = played.states["arm/laser"]
    np.testing.assert_allclose(state["position"], (10, 20, 30) + R @ (1, 2, 3), rtol=0, atol=1e-12)
    np.testing.assert_allclose(state["quaternion"], multiply(turn, at_laser[3:7]), rtol=0, atol=1e-12)
    np.testing.assert_allclose(state["linear"], R @ at_laser[7:10], rtol=0, atol=1e-12)
    np.testing.assert_allclose(state["angular"], R @ at_laser[10:], rtol=0, atol=1e-12)
    trunk = played.states["arm/base_link"]
    arm_of = state["position"] - trunk["position"]
    np.testing.assert_allclose(trunk["linear"] + np.cross(trunk["angular"], arm_of), state["linear"], atol=1e-12)
    assert state["orientation_stddev"] == pytest.approx(0.1) and trunk["position_stddev"] >= 0.1
    (text,) = played.refusals  # of the wheels and the lift, whose joints have not come
    assert text.startswith("arm: expected positions of lift, left_wheel_joint, ")


def test_a_base_follows_a_moving_frame_of_tf() -> None:
    played, robot = Played({**BOLTED, "base": {"frame": "cart", "pose": [0, 0, 0.3]}}), arm()
    for k in range(3):
        stamp = START + k * 100 * MILLISECOND
        played.send("/tf", TF, transform(stamp, "map", "cart", (0.2 * k, 0, 0), turned(0, 0, 0)), stamp)
    stamp = START + 200 * MILLISECOND
    played.joints(stamp, np.zeros(8), np.zeros(8))
    check(played, robot, np.zeros((8, 2)), base_row((0.4, 0, 0.3), linear=(2, 0, 0)), atol=1e-9)
    assert len(played.states) == 10  # the base link moved with its transform


def test_the_links_of_a_base_that_stands_in_tf_become_static() -> None:
    played = Played({**BOLTED, "base": {"frame": "mount"}})
    played.joints(START, np.zeros(8), np.zeros(8))
    assert not played.states and any("no transform from 'map' to 'mount'" in text for text in played.refusals)
    played.send("/tf_static", TF, transform(START, "map", "mount", (1, 2, 3)))
    played.joints(START + MILLISECOND, np.zeros(8), np.zeros(8))
    at = played.objects["arm/base"].pose
    assert at is not None and at.position.tolist() == [1, 2, 3] and len(played.states) == 10


def test_odometry_of_a_frame_that_is_no_link_is_refused() -> None:
    played = Played({"urdf": str(MOBILE), "base": {"odometry": "/odom"}})
    played.send("/odom", ODOMETRY, odometry(START, base_row((0, 0, 0)), "robot_1/base_link"), START)
    assert any("got 'robot_1/base_link'; name it with `link: …`" in text for text in played.refusals)
    played.send("/odom", ODOMETRY, odometry(START, base_row((0, 0, 0)), "left_wheel"), START)
    assert any("expected a link that is rigid with base_footprint, got left_wheel" in text for text in played.refusals)


def test_a_urdf_may_come_on_a_topic_and_change() -> None:
    file = {"urdf_topic": "/robot_description", "srdf_topic": "/srdf", "joint_states": "/joint_states"}
    played = Played({**file, "base": {"pose": [0, 0, 0]}})
    assert not played.objects
    played.joints(START, np.zeros(8), np.zeros(8))
    assert any("/joint_states came before its URDF on /robot_description" in text for text in played.refusals)
    played.send("/srdf", STRING, message(STRING, data=ARM.with_suffix(".srdf").read_text()))
    played.send("/robot_description", STRING, message(STRING, data=ARM.read_text()))
    assert len(played.objects) == 11
    ids = {name: it.object_id for name, it in played.objects.items()}
    assert ids["arm/right_finger"] in played.objects["arm/left_finger"].allowed
    played.joints(START + MILLISECOND, np.zeros(8), np.zeros(8))
    assert len(played.states) == 10
    shorter = ARM.read_text().replace("right_finger", "third_finger")
    played.send("/robot_description", STRING, message(STRING, data=shorter))
    assert "arm/right_finger" not in played.objects and "arm/third_finger" in played.objects
    assert all(played.objects[name].object_id == ids[name] for name in ids if name != "arm/right_finger")
    played.send("/robot_description", STRING, message(STRING, data="<robot"))
    assert any("arm: /robot_description, line 1: expected XML" in text for text in played.refusals)
    played.joints(START + 2 * MILLISECOND, np.zeros(8), np.zeros(8))
    assert len(played.states) == 10


def test_keys_of_a_robot_reach_its_links() -> None:
    floor = {"floor": {"static": True, "shape": {"half_space": [0, 0, 1, 0]}}}
    keys = {"padding": 0.02, "group": 2, "mask": 5, "model": "convex_hull", "allowed": {"base": ["floor"]}}
    played = Played({**BOLTED, **keys, "srdf": str(ARM.with_suffix(".srdf"))}, objects=floor)
    links = {name: it for name, it in played.objects.items() if name != "floor"}
    assert all((it.padding, it.group, it.mask) == (0.02, 2, 5) for it in links.values())
    assert all(it.model is Model.CONVEX_HULL for it in links.values())
    assert played.objects["floor"].object_id in links["arm/base"].allowed
    robot = Robot(Description.read(ARM), Description.read(ARM.with_suffix(".srdf")))
    for a in robot.links:
        expected = {b for pair in robot.touching | robot.disabled if a in pair for b in pair if b != a}
        ids = {links[f"arm/{b}"].object_id for b in expected}
        assert {*links[f"arm/{a}"].allowed} - {played.objects["floor"].object_id} == ids


@pytest.mark.parametrize(
    ("robot", "text"),
    [
        ({}, "arm, urdf: expected `urdf: FILE` or `urdf_topic: TOPIC`, got both or none"),
        ({"urdf": "nowhere.urdf"}, "arm, urdf: expected the file"),
        ({"urdf": "package://nowhere/arm.urdf"}, "arm, urdf: expected the file 'package://nowhere/arm.urdf' in the"),
        ({"urdf": str(ARM.with_suffix(".srdf"))}, "expected 1 to 2000 links, got 0"),
        ({**BOLTED, "srdf": "a", "srdf_topic": "/b"}, "arm, srdf: expected `srdf: FILE` or `srdf_topic: TOPIC`"),
        ({**BOLTED, "base": {"odometry": "/odom", "frame": "a"}}, "arm, base: expected `odometry`, or `frame` and"),
        ({**BOLTED, "base": {"pose": [1, 2]}}, "arm, base, pose: expected [x, y, z] or"),
        ({**BOLTED, "bases": {}}, "arm: 'bases' is unknown: did you mean 'base'?"),
        ({**BOLTED, "model": "hull"}, "arm, model: expected one of auto, exact"),
        ({**BOLTED, "padding": -1}, "arm, padding: expected a number of m from 0"),
        ({**BOLTED, "allowed": {"base": ["floor"]}}, "arm, allowed: 'floor' is unknown"),
        ({**BOLTED, "allowed": ["floor"]}, "arm, allowed: expected lists of objects by link"),
        ({**BOLTED, "motion": "straight"}, "arm, motion: expected joints or arc, got 'straight'"),
        ({**BOLTED, "arguments": {"prefix": "a"}}, "arm, arguments: expected a table of values of a xacro file, got"),
        ({**BOLTED, "packages": ["a"]}, "arm, packages: expected a table of folders by package"),
    ],
)
def test_an_entry_that_cannot_be_used_is_refused_with_its_key(robot: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError) as caught:
        Played(robot)
    assert text in str(caught.value)


def test_paths_are_relative_to_the_file_and_errors_name_its_line(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM.read_text())
    path = tmp_path / "sources.yaml"
    path.write_text("frame: map\nrobots:\n  arm:\n    urdf: arm.urdf\n    base: {pose: [0, 0, 0]}\n")
    Feed(load_mapping(path), Decoder(definitions()))
    macros = ARM.read_text().replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ', 1)
    (tmp_path / "arm.xacro").write_text(macros.replace("</robot>", "<xacro:arg name='fast' default='1'/></robot>"))
    lines = "    urdf: arm.xacro\n    arguments: {fast: true}\n    base: {pose: [0, 0, 0]}\n"
    path.write_text(f"frame: map\nrobots:\n  arm:\n{lines}")
    Feed(load_mapping(path), Decoder(definitions()))
    path.write_text("frame: map\nrobots:\n  arm:\n    urdf: arms.urdf\n")
    mapping = load_mapping(path)
    with pytest.raises(InputError) as caught:
        Feed(mapping, Decoder(definitions()))
    assert mapping.located(str(caught.value)).startswith(f"{path}, line 4: arm, urdf: expected the file '{tmp_path}")


def test_time_that_jumps_back_begins_anew() -> None:
    played = Played(BOLTED)
    played.joints(START, np.zeros(8), np.zeros(8))
    early = START - 100 * SECOND
    for k in range(3):
        played.joints(early + k * 100 * MILLISECOND, np.full(8, 0.5), np.zeros(8))
    assert len(played.states) == 10 and played.steps[-1].stamp_ns == early + 200 * MILLISECOND


def test_the_file_to_start_from_holds_the_robots_that_are_there() -> None:
    topics = [
        Seen("/robot_description", STRING),
        Seen("/joint_states", "sensor_msgs/msg/JointState", ("",)),
        Seen("/monitored_planning_scene", "moveit_msgs/msg/PlanningScene"),
        Seen("/hall/cart_2/joint_states", "sensor_msgs/msg/JointState"),
        Seen("/hall/cart_2/odom", ODOMETRY, ("map",)),
    ]
    content = yaml.safe_load(sources_file(topics, {}))
    assert content["robots"] == {
        "robot": {
            "urdf_topic": "/robot_description",
            "joint_states": "/joint_states",
            "planning_scene": "/monitored_planning_scene",
        },
        "hall_cart_2": {"urdf": "robot.urdf", "joint_states": "/hall/cart_2/joint_states"},
    }
    assert list(content["objects"]) == ["hall_cart_2_odom"]
    alone = yaml.safe_load(sources_file([Seen("/scene", "moveit_msgs/msg/PlanningScene")], {}))
    assert alone["objects"] == {"scene": {"topic": "/scene"}} and "robots" not in alone
    bolted = yaml.safe_load(sources_file(topics[:2], {}))
    assert "objects" not in bolted and make_mapping(bolted).frame == "map"
    bolted = yaml.safe_load(sources_file(topics[:2], {"tool": "map"}))
    assert "objects" not in bolted and make_mapping(bolted).frame == "map"


@pytest.mark.parametrize("parents", [{}, {"cart": "map"}])
def test_a_file_to_start_from_without_an_object_says_so(parents: dict[str, str]) -> None:
    text = sources_file([], parents)
    assert NOTHING in text and ("# cart:" in text) == bool(parents)
    with pytest.raises(InputError, match="objects: expected at least one"):
        make_mapping(yaml.safe_load(text))


def test_a_robot_without_joint_states_moves_with_its_frame_alone() -> None:
    played = Played({"urdf": str(MOBILE), "base": {"frame": "base_link"}})
    for k in range(3):
        stamp = START + k * 100 * MILLISECOND
        played.send("/tf", TF, transform(stamp, "map", "base_link", (0.2 * k, 0, 0)), stamp)
    assert played.steps[-1].stamp_ns == START + 200 * MILLISECOND
    assert set(played.states) == {"arm/base_link", "arm/mast", "arm/laser"}
    np.testing.assert_allclose(played.states["arm/base_link"]["linear"], (2, 0, 0), rtol=0, atol=1e-9)


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize("number", [np.nan, np.inf, 1e300, 1e18])
def test_numbers_without_end_stop_nothing(number: float) -> None:
    played = Played({**BOLTED, "base": {"frame": "mount"}})
    played.send("/tf_static", TF, transform(START, "map", "mount", (number, 0, 0)))
    played.joints(START, np.full(8, number), np.full(8, number))
    moving = Played({"urdf": str(MOBILE), "base": {"odometry": "/odom"}})
    moving.send("/tf_static", TF, transform(START, "map", "odom", (number, 0, 0)))
    moving.send("/odom", ODOMETRY, odometry(START, base_row((number, 0, 0), linear=(number, 0, 0)), "base_link"), START)
    good = odometry(START + SECOND // 10, base_row((1, 0, 0)), "base_link")
    moving.send("/odom", ODOMETRY, good, START)
    assert played.refusals or number == 1e18


def test_a_bag_of_a_robot_is_imported(tmp_path: Path) -> None:
    (tmp_path / "sources.yaml").write_text(
        "frame: map\nrate: 50\nrobots:\n  arm:\n    urdf_topic: /robot_description\n"
        "    joint_states: /joint_states\n    base: {pose: [0, 0, 0]}\n"
    )
    joints = "sensor_msgs/msg/JointState"
    messages: list[Any] = [("/robot_description", START, (STRING, message(STRING, data=ARM.read_text())))]
    for k in range(20):
        stamp = START + 5 * k * MILLISECOND
        content = message(joints, header=header("", stamp), name=JOINTS, position=np.full(8, 0.01 * k))
        messages.append(("/joint_states", stamp, (joints, content)))
    bag = write_bag(tmp_path / "bag", messages)
    imported = import_bag(bag, tmp_path / "run.mcap", load_mapping(tmp_path / "sources.yaml"))
    assert imported.whole and imported.steps == 5, imported
    assert imported.states["arm/hand"] == 5


def test_a_covariance_of_the_base_that_is_none_is_ignored_and_counted() -> None:
    played = Played({"urdf": str(MOBILE), "base": {"odometry": "/odom"}}, frame="odom")
    played.send("/odom", ODOMETRY, odometry(START, base_row((0, 0, 0)), "base_link", -0.5), START)
    assert any("base: expected symmetric covariances" in text for text in played.refusals)
    assert played.states["arm/base_link"]["position_stddev"] == 0.0
