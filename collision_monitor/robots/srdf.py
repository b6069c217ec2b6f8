"""SRDF: the pairs of links whose collisions are not checked.

Format: http://wiki.ros.org/srdf. Groups, states and end effectors are not read.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from collision_monitor.settings.xml_tree import Element, parse_xml

Pair = tuple[str, str]

MOST_DISABLED: Final = 100_000
"""Pairs that an SRDF may disable: all those of 450 links."""


def ordered(a: str, b: str) -> Pair:
    """Return a pair of names in alphabetical order."""
    return (a, b) if a <= b else (b, a)


def disabled_pairs(text: str | bytes, name: str, links: Collection[str]) -> set[Pair]:
    """Return the disabled pairs of a robot with these links; the SRDF may also name links that the robot lacks.

    <disable_default_collisions> disables all pairs of a link, <enable_collisions> enables one of them again.
    name: of the file or topic, for errors. Raises InputError with file, line and element.
    """
    robot = parse_xml(text, name)
    if robot.tag != "robot":
        raise robot.error("expected an SRDF with <robot> as its outermost element")
    silent = {element.text("link") for element in robot.all("disable_default_collisions")}
    if len(silent) * len(links) > MOST_DISABLED:
        raise robot.error(f"expected at most {MOST_DISABLED} pairs that are disabled, got {len(silent) * len(links)}")
    pairs = {ordered(a, b) for a in silent for b in links if a != b}
    pairs -= {_pair(element) for element in robot.all("enable_collisions")}
    pairs |= {_pair(element) for element in robot.all("disable_collisions")}
    if len(pairs) > MOST_DISABLED:
        raise robot.error(f"expected at most {MOST_DISABLED} pairs that are disabled, got {len(pairs)}")
    return pairs


def _pair(element: Element) -> Pair:
    return ordered(element.text("link1"), element.text("link2"))
