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
    ahead: float
    unfit: str

    def __eq__(self, other: object) -> bool:
        """Compare all fields."""
        if not isinstance(other, RuleCoverage):
            return NotImplemented
        mine, theirs = ((o.rule, o.against, o.reach, o.ahead, o.unfit, o.ids.tolist()) for o in (self, other))
        return mine == theirs

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True)
class UnmonitoredObject:
    """The fields of the message in their order; the stamp in ns."""

    name: str
    reason: str
    since_ns: int
    is_silent: bool = False
    coverage: tuple[int, ...] = ()


def read_coverage(reader: Reader) -> RuleCoverage:
    """Read a RuleCoverage. Raises MessageError."""
    rule, against = reader.string("coverage.rule"), reader.string("coverage.against")
    ids = reader.sequence(np.uint32, 4, "coverage.ids")
    reach, ahead = reader.scalar("f8", "coverage.reach"), reader.scalar("f8", "coverage.ahead")
    return RuleCoverage(rule, against, ids, reach, ahead, reader.string("coverage.unfit"))


def write_coverage(writer: Writer, rule: RuleCoverage) -> None:
    """Write a RuleCoverage. Raises MessageError."""
    writer.string(rule.rule, "coverage.rule")
    writer.string(rule.against, "coverage.against")
    writer.sequence(rule.ids, np.uint32, 4)
    writer.scalar("f8", rule.reach, "coverage.reach")
    writer.scalar("f8", rule.ahead, "coverage.ahead")
    writer.string(rule.unfit, "coverage.unfit")


def read_unmonitored(reader: Reader) -> UnmonitoredObject:
    """Read an UnmonitoredObject. Raises MessageError."""
    name, reason = reader.string("unmonitored.name"), reader.string("unmonitored.reason")
    since_ns, is_silent = reader.stamp_ns(), reader.boolean("unmonitored.is_silent")
    coverage = reader.sequence(np.uint32, 4, "unmonitored.coverage")
    return UnmonitoredObject(name, reason, since_ns, is_silent, tuple(coverage.tolist()))


def write_unmonitored(writer: Writer, each: UnmonitoredObject) -> None:
    """Write an UnmonitoredObject. Raises MessageError."""
    writer.string(each.name, "unmonitored.name")
    writer.string(each.reason, "unmonitored.reason")
    writer.stamp_ns(each.since_ns)
    writer.scalar("u1", each.is_silent, "unmonitored.is_silent")
    writer.sequence(np.array(each.coverage, np.uint32), np.uint32, 4)
