"""The faults of benchmarks/guard_encounters.py: what each does to the nodes or to the messages, and how it ends."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from encounter_nodes import RACK, RULES, WHOLE_RACK, Nodes

CONFIGURE, CLEANUP, ACTIVATE, DEACTIVATE = 1, 2, 3, 4  # lifecycle_msgs/Transition


class Fault:
    """A fault, and none by itself. stops: whether the robot has to stand because of it."""

    name = "no fault"
    stops = False

    def __init__(self, generator: np.random.Generator) -> None:
        self._generator = generator

    def prepare(self, nodes: Nodes) -> None:
        """Prepare what takes long, before the robot drives."""

    def begin(self, nodes: Nodes) -> None:
        """Inject the fault."""

    def end(self, nodes: Nodes) -> None:
        """Take it back."""

    def delay(self, since: float) -> float:
        """Return by how much the states are late (s), at a time after the begin (s)."""
        return 0.0

    def crate(self, publish: Callable[[], None], lose: Callable[[], None]) -> None:
        """Publish the crate's state, or do not."""
        publish()

    def commands(self, nodes: Nodes, speed: float) -> list[Any]:
        """Return the commands of the planner at an instant."""
        return [nodes.command(speed)]


class NoRule(Fault):
    """No rule is in force."""

    name, stops = "no rule", True

    def begin(self, nodes: Nodes) -> None:
        """See Fault."""
        nodes.rules("rules: {}\n")

    def end(self, nodes: Nodes) -> None:
        """See Fault."""
        nodes.rules(RULES)


class OtherName(NoRule):
    """The rules name another robot."""

    name = "other name"

    def begin(self, nodes: Nodes) -> None:
        """See Fault."""
        other = str(self._generator.choice(["turtlebot", "robot_10*", "Robot_1", "robot1"]))
        nodes.rules(RULES.replace('["robot*", "cart*", "agv*"]', f'["{other}"]'))


class NotFinite(Fault):
    """A component of the commands is NaN, or infinite."""

    stops = True

    def __init__(self, generator: np.random.Generator, part: str, axis: str) -> None:
        super().__init__(generator)
        self.name = f"NaN in {part}.{axis}"
        self._part, self._axis = part, axis
        self._value = float(generator.choice([math.nan, math.nan, math.inf, -math.inf]))

    def commands(self, nodes: Nodes, speed: float) -> list[Any]:
        """See Fault."""
        command = nodes.command(speed)
        setattr(getattr(command.twist, self._part), self._axis, self._value)
        return [command]


class LateMonitor(Fault):
    """The states, and so the answers, arrive steadily and become later and later."""

    name, stops = "late monitor", True

    def __init__(self, generator: np.random.Generator) -> None:
        super().__init__(generator)
        self._most, self._rate = generator.uniform(0.6, 2.5), generator.uniform(0.5, 0.9)

    def delay(self, since: float) -> float:
        """See Fault."""
        return float(min(self._most, self._rate * since))


class StoppedMonitor(Fault):
    """The process of the monitor hangs."""

    name, stops = "stopped monitor", True

    def begin(self, nodes: Nodes) -> None:
        """See Fault."""
        nodes.freeze(True)

    def end(self, nodes: Nodes) -> None:
        """See Fault."""
        nodes.freeze(False)


class TwoMonitors(Fault):
    """A second monitor answers on the same topic, with the same rules."""

    name, stops = "two monitors", True

    def prepare(self, nodes: Nodes) -> None:
        """See Fault."""
        nodes.change_second(CONFIGURE)

    def begin(self, nodes: Nodes) -> None:
        """See Fault."""
        nodes.change_second(ACTIVATE)

    def end(self, nodes: Nodes) -> None:
        """See Fault."""
        nodes.change_second(DEACTIVATE, CLEANUP)


class RestartedMonitor(Fault):
    """The monitor is killed, and another process takes its place."""

    name, stops = "restarted monitor", True

    def begin(self, nodes: Nodes) -> None:
        """See Fault."""
        nodes.restart_monitor()


class SilentSource(Fault):
    """The source of the obstacle falls silent."""

    name, stops = "silent source", True

    def crate(self, publish: Callable[[], None], lose: Callable[[], None]) -> None:
        """See Fault."""


class MissingFrame(Fault):
    """The obstacle comes in a frame that tf does not have."""

    name, stops = "missing frame", True

    def crate(self, publish: Callable[[], None], lose: Callable[[], None]) -> None:
        """See Fault."""
        lose()


class MissingMesh(Fault):
    """A link of another machine comes with a mesh that is not there."""

    name, stops = "missing mesh", True

    def begin(self, nodes: Nodes) -> None:
        """See Fault."""
        mesh = str(self._generator.choice(["file:///nowhere/board.stl", "package://nobody/meshes/board.dae"]))
        nodes.rack(RACK.format(board=f'<mesh filename="{mesh}"/>'))

    def end(self, nodes: Nodes) -> None:
        """See Fault."""
        nodes.rack(WHOLE_RACK)


class OldCommand(Fault):
    """The commands are old by their stamp, from the future, or always have the same stamp."""

    name, stops = "old command", True

    def __init__(self, generator: np.random.Generator) -> None:
        super().__init__(generator)
        self._offset: float | None = float(generator.choice([-0.7, -60.0, -1e9, 0.5, 1e5]))
        if generator.random() < 0.3:
            self._offset = None
        self._stuck: int | None = None

    def commands(self, nodes: Nodes, speed: float) -> list[Any]:
        """See Fault."""
        if self._offset is not None:
            return [nodes.command(speed, nodes.now + int(self._offset * 1e9))]
        self._stuck = nodes.now if self._stuck is None else self._stuck
        return [nodes.command(speed, self._stuck)]


class Flood(Fault):
    """The planner sends a hundred commands in place of one. They pass, and the obstacle has to stop the robot."""

    name = "flood of commands"

    def commands(self, nodes: Nodes, speed: float) -> list[Any]:
        """See Fault."""
        return [nodes.command(speed) for _ in range(100)]


NOT_FINITE: Final = tuple((part, axis) for part in ("linear", "angular") for axis in "xyz")
OTHERS: Final = (
    *(NoRule, OtherName, LateMonitor, StoppedMonitor, TwoMonitors, RestartedMonitor),
    *(SilentSource, MissingMesh, MissingFrame, OldCommand, Flood),
)


def all_faults(generator: np.random.Generator) -> list[Fault]:
    """Return one of each fault, drawn anew."""
    finite = [NotFinite(generator, *each) for each in NOT_FINITE]
    return [*(kind(generator) for kind in OTHERS[:2]), *finite, *(kind(generator) for kind in OTHERS[2:])]


class History:
    """What was true when, so that it can be told late."""

    def __init__(self) -> None:
        self._kept: deque[tuple[float, Any]] = deque(maxlen=600)
        self._told = -math.inf

    def keep(self, at: float, what: Any) -> None:
        """Keep what is true at a time (s)."""
        self._kept.append((at, what))

    def newest(self, until: float) -> Any:
        """Return what was true last before a time (s), if it has not been told; None: nothing."""
        at, what = next(((at, what) for at, what in reversed(self._kept) if at <= until), (-math.inf, None))
        if at <= self._told:
            return None
        self._told = at
        return what
