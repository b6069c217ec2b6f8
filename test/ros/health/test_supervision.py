"""What a supervisor of the node sees: /diagnostics, the deadline and the liveliness of the answers."""

from __future__ import annotations

import signal

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import LivelinessPolicy, QoSProfile

from collision_monitor import records
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.registry import Sphere
from collision_monitor_msgs.msg import PredictedCollisionArray

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
SECOND = Duration(seconds=1)


def state(object_id, x=0.0):
    row = np.zeros((), records.STATE)
    row["id"], row["position"][0], row["quaternion"] = object_id, x, (0, 0, 0, 1)
    return row


class Supervisor:
    """Keeps the last diagnostics by name, the number of missed deadlines, and whether the publisher is alive."""

    def __init__(self, team):
        self.reports, self.missed, self.alive, self.stamps = {}, 0, 0, []
        team.node.create_subscription(DiagnosticArray, "/diagnostics", self._take, 10)
        quality = QoSProfile(depth=10, deadline=SECOND, liveliness_lease_duration=SECOND)
        quality.liveliness = LivelinessPolicy.MANUAL_BY_TOPIC
        events = SubscriptionEventCallbacks(deadline=self._on_deadline, liveliness=self._on_liveliness)
        topic = "/object_monitor/predictions"
        team.node.create_subscription(
            PredictedCollisionArray, topic, lambda message: None, quality, event_callbacks=events
        )

    def _take(self, message):
        self.stamps.append(message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)
        for status in message.status:
            self.reports[status.name] = status

    def _on_deadline(self, event):
        self.missed = event.total_count

    def _on_liveliness(self, event):
        self.alive = event.alive_count

    def level(self, task):
        return self.reports[f"object_monitor: {task}"].level

    def says(self, task, level, text):
        found = self.reports.get(f"object_monitor: {task}")
        return found is not None and found.level == level and text in found.message


def test_the_diagnostics_follow_what_happens(start, team):
    start("run", "--record", "run.mcap", "--ros-args", "-p", "diagnostic_updater.period:=0.2", "-p", "stale_after:=0.3")
    supervisor = Supervisor(team)
    team.meet()

    def until(task, level, text, rows=()):
        """Repeat the states until the report is there."""
        timer = team.node.create_timer(0.05, lambda: team.say(*rows)) if rows else None
        team.until(lambda: supervisor.says(task, level, text))
        if timer is not None:
            team.node.destroy_timer(timer)

    until("inputs", WARN, "no object is described")
    until("recording", OK, "recording to run.mcap")
    assert supervisor.level("state") == OK
    team.describe(*(ObjectDescription(k, Sphere(0.5), name=f"ball {k}") for k in (1, 2)))
    until("inputs", ERROR, "unseen: no state yet of object 1 ('ball 1'), 2 ('ball 2')")
    until("inputs", OK, "2 objects, all up to date", [state(1), state(2, 3.0)])
    until("steps", OK, "steps/s", [state(1), state(2, 3.0)])
    until("inputs", ERROR, "stale: no usable new state of object 2 ('ball 2')", [state(1)])
    until("inputs", ERROR, "silent: no newer states on /object_monitor/objects/states")
    until("inputs", ERROR, "refused lately: ", [state(1), state(2, 3.0), state(77)])
    report = supervisor.reports["object_monitor: inputs"]
    values = {each.key: each.value for each in report.values}
    assert (report.hardware_id, values["objects"], values["objects_static"]) == ("none", "2", "0")
    assert {name for name in supervisor.reports} == {
        f"object_monitor: {task}" for task in ("state", "inputs", "steps", "recording")
    }


def test_a_dead_or_hanging_node_is_noticed_and_silence_is_distinguished(start, team):
    monitor = start("run", "--ros-args", "-p", "diagnostic_updater.use_fqn:=true", "-r", "__ns:=/")
    supervisor = Supervisor(team)
    team.meet()
    team.describe(ObjectDescription(1, Sphere(0.5)))
    team.status(lambda s: s.objects == 1)
    team.ask(state(1))
    team.until(lambda: supervisor.alive == 1)
    team.until(lambda: supervisor.missed)  # no states, so no answers
    team.listen(1.5)
    assert supervisor.alive == 1, "the node lives without states"
    assert "/object_monitor: steps" in supervisor.reports
    monitor.send(signal.SIGSTOP)  # it hangs
    team.until(lambda: supervisor.alive == 0)
    monitor.send(signal.SIGCONT)
    team.until(lambda: supervisor.alive == 1)
    monitor.send(signal.SIGKILL)
    team.until(lambda: supervisor.alive == 0)
