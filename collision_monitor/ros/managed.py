"""A managed (lifecycle) node whose failed transitions are logged and can be repeated, and that no request ends.

rclpy alone swallows the exception of a transition without a line in the log (rclpy issue 1673), and ends the process
with an RCLError at a transition that the state does not have.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any, Final

from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from collision_monitor.errors import CollisionMonitorError

FINALIZED: Final = "finalized"


class Managed(LifecycleNodeMixin):
    """Adds the life cycle to a Node. Call `Node.__init__` first; the services are there after `Managed.__init__`.

    A subclass defines `configure`, `activate`, `deactivate` and `cleanup`. An exception in one of them is logged with
    its cause; then `cleanup` is called and the node is unconfigured. `cleanup` must accept any state.

    failure: the last failed transition and its cause; empty after one that succeeded.
    """

    failure = ""

    def __init__(self) -> None:
        LifecycleNodeMixin.__init__(self)
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._on_change_state

    def configure(self) -> None:
        """Make the publishers, subscriptions and timers."""
        raise NotImplementedError

    def activate(self) -> None:
        """Begin to publish; the managed publishers are active already."""
        raise NotImplementedError

    def deactivate(self) -> None:
        """Stop to publish; the managed publishers are inactive already."""
        raise NotImplementedError

    def cleanup(self) -> None:
        """Undo `configure`, complete or not."""
        raise NotImplementedError

    @property
    def state(self) -> str:
        """The label of the current state, such as `inactive`."""
        label: str = self._state_machine.current_state[1]
        return label

    def start(self) -> bool:
        """Configure and activate; return whether that succeeded. Its failure is logged and leaves it unconfigured."""
        return all(
            step() == TransitionCallbackReturn.SUCCESS for step in (self.trigger_configure, self.trigger_activate)
        )

    def finish(self) -> None:
        """Shut down from any state, so that the transition's event and the cleanup happen."""
        if self.state != FINALIZED:
            self.trigger_shutdown()

    # -- the callbacks of rclpy

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Called by rclpy, as are the following ones."""
        return self._attempt("configure", self.configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Activate the publishers, then the node."""
        return self._attempt("activate", lambda: super(Managed, self).on_activate(state), self.activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Deactivate the publishers, then the node."""
        return self._attempt("deactivate", lambda: super(Managed, self).on_deactivate(state), self.deactivate)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Clean up."""
        return self._attempt("cleanup", self.cleanup)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Clean up for the last time."""
        return self._attempt("shutdown", self.cleanup)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Clean up after a failed transition, so that the node can be configured again."""
        failure = self.failure
        if self._attempt("cleanup after an error", self.cleanup) == TransitionCallbackReturn.SUCCESS:
            self.failure = failure
        return TransitionCallbackReturn.SUCCESS

    def _attempt(self, transition: str, *work: Callable[[], Any]) -> TransitionCallbackReturn:
        """Do the work of a transition. If it raises, log the cause and return ERROR."""
        try:
            for part in work:
                part()
        except Exception as error:
            self.failure = f"{transition} failed: {error!r}"
            self.get_logger().error(
                f"{self.failure}; the node is unconfigured now. Remove the cause, then configure it again: "
                f"ros2 lifecycle set {self.get_fully_qualified_name()} configure"
            )
            if not isinstance(error, CollisionMonitorError | OSError):
                self.get_logger().error("".join(traceback.format_exception(error)))
            return TransitionCallbackReturn.ERROR
        self.failure = ""
        return TransitionCallbackReturn.SUCCESS

    def _on_change_state(self, request: Any, response: Any) -> Any:
        """Answer ~/change_state. A transition that the state does not have is refused."""
        available = {label: number for number, label, *_ in self._state_machine.available_transitions}
        wanted = request.transition
        is_there = wanted.label in available if wanted.label else wanted.id in available.values()
        if is_there:
            return self._change_state(request, response)
        self.get_logger().warning(
            f"transition {wanted.label or wanted.id!r}: expected one from the state {self.state}, "
            f"{', '.join(f'{label} ({number})' for label, number in available.items()) or 'which has none'}"
        )
        response.success = False
        return response
