"""RuleCoverage and UnmonitoredObject: whom the rules of the alerts cover, and what no answer covers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.cdr import Reader, Writer

LEAST_COVERAGE: Final = 32
"""Bytes of the shortest coverage."""

LEAST_UNMONITORED: Final = 24
"""Bytes of the shortest unmonitored object."""


@dataclass(frozen=True, eq=False)
class RuleCoverage:
    """The fields of the message in their order; ids (n,) uint32, ascending."""

    rule: str
    against: str
    ids: NDArray[np.uint32]
    reach: float
    delay: float
    unfit: str

    def __eq__(self, other: object) -> bool:
        """Compare all fields."""
        if not isinstance(other, RuleCoverage):
            return NotImplemented
        mine, theirs = ((o.rule, o.against, o.reach, o.delay, o.unfit, o.ids.tolist()) for o in (self, other))
        return mine == theirs

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True)
class UnmonitoredObject:
    """The fields of the message in their order; the stamp in ns."""

    name: str
    reason: str
    since_ns: int
    is_silent: bool = False
    rules: tuple[str, ...] = ()


def read_coverage(reader: Reader) -> RuleCoverage:
    """Read a RuleCoverage. Raises MessageError."""
    rule, against = reader.string("rules.rule"), reader.string("rules.against")
    ids = reader.sequence(np.uint32, 4, "rules.ids")
    reach, delay = reader.scalar("f8", "rules.reach"), reader.scalar("f8", "rules.delay")
    return RuleCoverage(rule, against, ids, reach, delay, reader.string("rules.unfit"))


def write_coverage(writer: Writer, rule: RuleCoverage) -> None:
    """Write a RuleCoverage. Raises MessageError."""
    writer.string(rule.rule, "rules.rule")
    writer.string(rule.against, "rules.against")
    writer.sequence(rule.ids, np.uint32, 4)
    writer.scalar("f8", rule.reach, "rules.reach")
    writer.scalar("f8", rule.delay, "rules.delay")
    writer.string(rule.unfit, "rules.unfit")


def read_unmonitored(reader: Reader) -> UnmonitoredObject:
    """Read an UnmonitoredObject. Raises MessageError."""
    name, reason = reader.string("unmonitored.name"), reader.string("unmonitored.reason")
    since_ns, is_silent = reader.stamp_ns(), reader.boolean("unmonitored.is_silent")
    return UnmonitoredObject(name, reason, since_ns, is_silent, tuple(reader.strings("unmonitored.rules")))


def write_unmonitored(writer: Writer, each: UnmonitoredObject) -> None:
    """Write an UnmonitoredObject. Raises MessageError."""
    writer.string(each.name, "unmonitored.name")
    writer.string(each.reason, "unmonitored.reason")
    writer.stamp_ns(each.since_ns)
    writer.scalar("u1", each.is_silent, "unmonitored.is_silent")
    writer.strings(list(each.rules), "unmonitored.rules")
