"""A ROS process that ends cleanly: signals ask it to stop, what runs is finished, exit code 0.

rclpy's own handlers shut the context down under the feet of a running callback, so that its last answers could not
be published nor its recording finished. Here a signal only sets a flag, which the spin loop reads.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from collision_monitor.errors import InputError

if TYPE_CHECKING:
    from rclpy.node import Node

WAKE_UP = 0.1
"""s: how long a stop request can stay unseen while no message arrives."""


class StopRequest:
    """Set by SIGINT or SIGTERM; further signals while shutting down change nothing."""

    def __init__(self) -> None:
        self.received = False
        self._ends = False

    def install(self) -> StopRequest:
        """Take over both signals; call it before the slow imports so that an early Ctrl-C is clean as well."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        return self

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self.received = True
        if self._ends:
            _end()

    @contextmanager
    def ending(self) -> Iterator[None]:
        """For long work with nothing to be finished: a signal ends the process, exit code 0.

        A KeyboardInterrupt would not do: raised within a callback of the compiler it is printed and forgotten.
        """
        self._ends = True
        if self.received:
            _end()
        try:
            yield
        finally:
            self._ends = False


def _end() -> None:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""The environment variables by which Fast DDS is configured, before and since its version 3."""


def stay_on_this_machine() -> None:
    """Keep DDS on loopback unless the user chose a discovery range, with room for large messages unless the user chose
    another configuration of Fast DDS. Both are read when the context is made.
    """
    if os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST") != "LOCALHOST":
        return
    if not any(name in os.environ for name in PROFILES):
        os.environ[PROFILES[0]] = str(Path(__file__).with_name("shared_memory.xml"))


@contextmanager
def ros_context(arguments: Sequence[str] | None = None) -> Iterator[None]:
    """rclpy from init to shutdown, without its signal handlers. Raises InputError for arguments ROS does not take.

    arguments: as sys.argv, also what is not for ROS.
    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    given = list(sys.argv if arguments is None else arguments)
    try:
        rclpy.init(args=given, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rclpy's own errors are no public classes
        raise InputError(f"expected ROS arguments (--ros-args -p name:=value …), got: {error}") from None
    try:
        yield
    finally:
        rclpy.try_shutdown()


def spin(node: Node, stop: StopRequest, *, events: bool = False) -> None:
    """Run the node's callbacks one after the other until a stop is asked for.

    `events`: use rclpy's EventsExecutor, which costs less CPU for each message. It is always driven with a timeout:
    without one it was seen to run no callback and burn a core (rclpy 7.1).
    """
    from rclpy.executors import Executor, SingleThreadedExecutor

    executor: Executor
    if events:
        from rclpy.experimental import EventsExecutor

        executor = EventsExecutor()
    else:
        executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not stop.received:
            executor.spin_once(timeout_sec=WAKE_UP)
    finally:
        executor.remove_node(node)
        executor.shutdown()
