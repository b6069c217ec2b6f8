"""Bad URDF and SRDF files give one clear text with file, line and element; good ones are read as the format says."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.errors import InputError
from collision_monitor.robots.kinematic_tree import kinematic_tree
from collision_monitor.robots.srdf import disabled_pairs
from collision_monitor.robots.urdf import JointType, parse_urdf
from collision_monitor.settings.xml_tree import DEEPEST

ARM = Path(__file__).parents[2] / "examples/arm/arm.urdf"

TWO = """<robot name="two">
<link name="a"/>
<link name="b"/>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/>
{0}
</joint>
{1}
</robot>"""


@pytest.mark.parametrize(
    ("inside", "after", "text"),
    [
        ('<origin xyz="0 0"/>', "", "robot.urdf, line 5, <origin>: xyz: expected 3 finite numbers, got '0 0'"),
        ('<origin rpy="0 nan 0"/>', "", "line 5, <origin>: rpy: expected 3 finite numbers, got '0 nan 0'"),
        ('<axis xyz="0 0 0"/>', "", "line 5, <axis>: xyz: expected an axis that is not zero"),
        ('<mimic joint="k"/>', "", "line 4, <joint name='j'>: mimic: expected a moving joint, and no loop, got"),
        ('<mimic joint="j"/>', "", "mimic: expected a moving joint, and no loop, got 'j'"),
        ('<mimic joint="j" multiplier="two"/>', "", "multiplier: expected a finite number, got 'two'"),
        ('<mimic multiplier="2"/>', "", "<mimic>: expected an attribute joint, got multiplier"),
        ("", '<link name="a"/>', "line 7, <link name='a'>: expected a name of its own, got that of robot.urdf, line 2"),
        ('<origin xyz="1_0 0 0"/>', "", "line 5, <origin>: xyz: expected 3 finite numbers, got '1_0 0 0'"),
        ('<origin xyz="\u0663 0 0"/>', "", "xyz: expected 3 finite numbers"),
        ("", f'<link name="{"x" * 257}"/>', "name: expected at most 256 characters, got 257"),
        ("", f'<link {"x" * 1000}="1"/>', f"expected an attribute name, got {'x' * 200}"),
        ("", "<link/>", "line 7, <link>: expected an attribute name, got no attribute"),
        ("", '<link name="c"/>', "expected one link without a parent in the file, got a, c"),
        ("", '<joint name="k" type="fixed"><parent link="b"/></joint>', "expected <child link=…>, got none"),
        ("", '<joint name="k" type="ball"/>', "type: expected one of fixed, revolute, continuous, prismatic, planar, "),
        (
            "",
            '<joint name="k" type="fixed"><parent link="b"/><child link="d"/></joint>',
            "expected links that the file has, got 'd'",
        ),
        (
            "",
            '<joint name="k" type="fixed"><parent link="a"/><child link="b"/></joint>',
            "expected a child without a parent, but 'b' has two joints to one",
        ),
        (
            "",
            '<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint>',
            "got none, because the joints form a loop",
        ),
        (
            "",
            '<link name="c"/><joint name="k" type="floating"><parent link="b"/><child link="c"/></joint>',
            "expected a floating joint only between a root link without shapes and its one child",
        ),
        ("", '<link name="c"><collision/></link>', "<collision>: expected <geometry> with a shape in it, got none"),
        ("", "<xacro:macro/>", "expected a URDF, got a xacro file; convert it with `xacro FILE > ROBOT.urdf`"),
        ("<", "", "robot.urdf, line 5: expected XML, got: not well-formed"),
    ],
)
def test_a_bad_urdf_is_refused_with_file_line_and_element(inside: str, after: str, text: str) -> None:
    head = '<robot xmlns:xacro="http://ros.org/wiki/xacro" ' if "xacro" in after else "<robot "
    with pytest.raises(InputError) as caught:
        kinematic_tree(parse_urdf(TWO.replace("<robot ", head).format(inside, after), "robot.urdf"))
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "expected XML, got: no element found"),
        ("<robot/>", "expected 1 to 2000 links, got 0"),
        ("<sdf/>", "expected a URDF with <robot> as its outermost element"),
        ("<!DOCTYPE r [<!ENTITY a 'b'>]><robot name='&a;'/>", "expected XML without a document type"),
        ("<a>" * (DEEPEST + 1), f"expected at most 200000 elements and {DEEPEST} levels of XML, got more"),
        ("<robot>" + "<link name='a'/>" * 200_001, "expected at most 200000 elements"),
        (" " * ((16 << 20) + 1), "expected XML of at most 16777216 characters"),
    ],
)
def test_a_file_that_is_no_urdf_or_too_large_is_refused(text: str, reason: str) -> None:
    with pytest.raises(InputError, match=r"robot\.urdf") as caught:
        parse_urdf(text, "robot.urdf")
    assert reason in str(caught.value)


@given(st.data())
def test_a_damaged_urdf_is_read_or_refused(data: st.DataObject) -> None:
    text = bytearray(ARM.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        if data.draw(st.booleans()):
            text[at] = data.draw(st.integers(0, 255))
        else:
            del text[at : at + data.draw(st.integers(1, 40))]
    with suppress(InputError):
        kinematic_tree(parse_urdf(bytes(text), "arm.urdf"))


BOX = '<geometry><box size="1 1 1"/></geometry>'


@pytest.mark.parametrize(
    "left",
    [
        '<xacro:arm prefix="x"/>',
        '<link name="c"><xacro:box_collision/></link>',
        f'<link name="c"><collision><xacro:origin/>{BOX}</collision></link>',
        '<link name="${prefix}c"/>',
        '<link name="c"><collision><geometry><mesh filename="$(find arm)/c.stl"/></geometry></collision></link>',
    ],
)
def test_what_is_left_of_a_xacro_file_is_no_urdf(left: str) -> None:
    """A macro that nobody replaced may be a shape, which would not be monitored."""
    with pytest.raises(InputError, match=r"line 7, <[a-z:]+.*>: expected a URDF, got a xacro file; convert it with"):
        parse_urdf(TWO.format("", left), "robot.urdf")
    ignored = '<gazebo><plugin filename="$(find x)"/></gazebo><link name="c"><visual name="${x}"/></link>'
    assert "c" in parse_urdf(TWO.format("", ignored), "robot.urdf").links


@pytest.mark.parametrize(
    "inside", [f'<geometry><sphere radius="2"/>{BOX[10:]}', f'<geometry><sphere radius="2"/></geometry>{BOX}']
)
def test_no_shape_of_a_collision_is_left_out(inside: str) -> None:
    """The format has one. Other readers take the first, or the last."""
    text = TWO.format("", f'<link name="c"><collision><origin xyz="0 0 1"/>{inside}</collision></link>')
    first, second = parse_urdf(text, "robot.urdf").links["c"].collisions
    assert (first.geometry.tag, second.geometry.tag) == ("sphere", "box")
    assert first.pose.position.tolist() == second.pose.position.tolist() == [0, 0, 1]


def test_defaults_are_those_of_the_format() -> None:
    urdf = parse_urdf(TWO.format("", ""), "robot.urdf")
    joint = urdf.joints["j"]
    assert joint.type is JointType.REVOLUTE and joint.axis.tolist() == [1, 0, 0] and joint.mimic is None
    assert joint.origin.position.tolist() == [0, 0, 0] and joint.origin.quaternion.tolist() == [0, 0, 0, 1]


def test_a_floating_or_planar_joint_at_the_root_leaves_the_pose_of_the_base_to_others() -> None:
    for kind in ("floating", "planar"):
        tree = kinematic_tree(parse_urdf(TWO.format("", "").replace("revolute", kind), "robot.urdf"))
        assert tree.links == ("b",) and tree.joints == ()


def test_mimics_of_mimics_follow_the_first_joint() -> None:
    joints = '<link name="c"/><joint name="k" type="prismatic"><parent link="b"/><child link="c"/>'
    joints += '<mimic joint="l" multiplier="2" offset="1"/></joint>'
    joints += '<link name="d"/><joint name="l" type="revolute"><parent link="c"/><child link="d"/>'
    joints += '<mimic joint="j" multiplier="-3" offset="0.5"/></joint>'
    tree = kinematic_tree(parse_urdf(TWO.format("", joints), "robot.urdf"))
    row = tree.links.index("c")
    assert tree.joints == ("j",)
    assert (tree.table.multiplier[row], tree.table.offset[row]) == (-6, 2)


def test_srdf_disables_pairs() -> None:
    text = """<robot name="r"><disable_default_collisions link="b"/><enable_collisions link1="c" link2="b"/>
        <disable_collisions link1="d" link2="a" reason="Never"/></robot>"""
    assert disabled_pairs(text, "r.srdf", "abcd") == {("a", "b"), ("b", "d"), ("a", "d")}
    with pytest.raises(InputError, match=r"r.srdf, line 1, <disable_collisions>: expected an attribute link2"):
        disabled_pairs('<robot><disable_collisions link1="a"/></robot>', "r.srdf", "ab")
