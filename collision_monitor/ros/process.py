"""A ROS process that ends cleanly: signals request a stop, the running work is finished, and the exit code is 0.

rclpy's own handlers shut the context down during a callback, so that it cannot publish its last answers nor finish its
recording. Here a signal only sets a flag, which the spin loop reads.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Final

from collision_monitor.errors import InputError, UnsupportedError

if TYPE_CHECKING:
    from rclpy.node import Node

WAKE_UP = 0.1
"""Longest time (s) until a stop request is seen while no message arrives."""


STOP_S: Final = 1.9
"""Longest time (s) from a signal to the end of the process, whatever it does at that time. Supervisors wait 2 s and
more before they kill."""

FINISH_S: Final = 0.9
"""Time (s) from a signal until `StopRequest.on_stuck` is called, if the process still runs: half of STOP_S is for the
ordinary end, half for finishing a recording without the thread that is stuck."""


FAILURE_PERIOD: Final = 10.0
"""s between two lines of the log about the same error of a callback."""

MOST_FAILURES: Final = 100
"""Different errors whose last lines are remembered."""


class StopRequest:
    """Set by SIGINT or SIGTERM. Further signals during the shutdown change nothing.

    A thread ends the process with `code` if it still runs `within` seconds after the first signal, for example within
    native code. on_stuck: called by another thread at FINISH_S, to bring to safety what must not be lost.
    """

    def __init__(self, within: float = STOP_S, code: int = 0) -> None:
        self.received = False
        self._within = within
        self._code = code
        self.on_stuck: Callable[[], None] | None = None
        self._ends = False

    def install(self) -> StopRequest:
        """Take over both signals. Call it before the slow imports, so that an early Ctrl-C is clean as well."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        # Python calls `_on_signal` between two of its own instructions only, but writes to this pipe at once
        waiting, woken = os.pipe()
        os.set_blocking(woken, False)
        signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
        threading.Thread(target=self._end_in_time, args=(waiting,), name="stop", daemon=True).start()
        return self

    def _end_in_time(self, waiting: int) -> None:
        numbers = b""
        while signal.SIGINT not in numbers and signal.SIGTERM not in numbers:  # other signals have other handlers
            numbers = os.read(waiting, 64)
        began = time.monotonic()
        time.sleep(FINISH_S)
        finishing = threading.Thread(target=self.on_stuck or (lambda: None), name="finish", daemon=True)
        finishing.start()
        end = began + self._within
        finishing.join(end - time.monotonic())
        time.sleep(max(0.0, end - time.monotonic()))
        os.write(2, b"collision-monitor: ended within its work, which took too long after the signal\n")
        os._exit(self._code)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self.received = True
        if self._ends:
            _end()

    @contextmanager
    def ending(self) -> Iterator[None]:
        """Let a signal end the process with exit code 0, during long work that needs no finishing.

        A KeyboardInterrupt would not do: if it is raised within a callback of the compiler, it is printed and ignored.
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
"""The environment variables that configure Fast DDS, before and since its version 3."""


def stay_on_this_machine() -> None:
    """Keep DDS on loopback unless the user chose a discovery range, and give it room for large messages.

    The room is not changed if the user chose another configuration of Fast DDS. Both are read when the context is made.
    """
    if os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST") != "LOCALHOST":
        return
    if not any(name in os.environ for name in PROFILES):
        os.environ[PROFILES[0]] = str(Path(__file__).with_name("shared_memory.xml"))


@contextmanager
def ros_context(arguments: Sequence[str] | None = None) -> Iterator[None]:
    """Run rclpy from init to shutdown, without its signal handlers.

    Raises InputError for arguments that ROS refuses, UnsupportedError without ROS 2.

    arguments: as sys.argv, including those that are not for ROS.
    """
    try:
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    except ModuleNotFoundError as error:
        raise UnsupportedError(
            f"expected ROS 2, got no module {error.name!r}: source a ROS 2 install (source /opt/ros/jazzy/setup.bash), "
            "or run `make setup` in a clone, which installs ROS 2 into .venv"
        ) from None

    given = list(sys.argv if arguments is None else arguments)
    _find_place_for_log()
    try:
        rclpy.init(args=given, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rclpy's own error classes are not public
        if "logging directory" in str(error):
            raise InputError("expected a folder for the log of ROS that can be written to: set ROS_LOG_DIR") from None
        raise InputError(f"expected ROS arguments (--ros-args -p name:=value …), got: {error}") from None
    try:
        yield
    finally:
        rclpy.try_shutdown()


def _find_place_for_log() -> None:
    """Let ROS log into a new temporary folder if the user has no home that can be written to; it would not start."""
    home = os.environ.get("HOME", "")
    if not {"ROS_LOG_DIR", "ROS_HOME"} & os.environ.keys() and not (home and os.access(home, os.W_OK)):
        with suppress(OSError):
            os.environ["ROS_LOG_DIR"] = tempfile.mkdtemp(prefix="ros_log_")


def spin(node: Node, stop: StopRequest, *, events: bool = False) -> None:
    """Run the node's callbacks one after the other until a stop is requested.

    events: use rclpy's EventsExecutor, which costs less CPU for each message. It always gets a timeout, because without
    one it was seen to run no callback and to use a full core (rclpy 7.1).
    """
    from rclpy.executors import Executor, SingleThreadedExecutor

    executor: Executor
    if events:
        from rclpy.experimental import EventsExecutor

        executor = EventsExecutor()
    else:
        executor = SingleThreadedExecutor()
    executor.add_node(node)
    failures: dict[str, float] = {}
    try:
        while not stop.received:
            try:
                executor.spin_once(timeout_sec=WAKE_UP)
            except Exception as error:  # one callback failed: the others go on
                if not node.context.ok():
                    raise
                _log_failure(node, error, failures)
    finally:
        executor.remove_node(node)
        executor.shutdown()


def _log_failure(node: Node, error: Exception, logged: dict[str, float]) -> None:
    """Log an error of a callback that nobody expected, the same one every FAILURE_PERIOD at most. logged: when."""
    text = "".join(traceback.format_exception(error, limit=-8))
    now = time.monotonic()
    if now - logged.get(text, -FAILURE_PERIOD) < FAILURE_PERIOD:
        return
    if len(logged) >= MOST_FAILURES:
        logged.clear()
    logged[text] = now
    node.get_logger().error(f"a callback failed, the node goes on; please report this:\n{text}")
