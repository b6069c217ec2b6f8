"""The life cycle of the node by its services, as ros2 lifecycle and nav2's lifecycle manager use them."""

from __future__ import annotations

import resource
from pathlib import Path

import numpy as np
from lifecycle_msgs.msg import State, Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from rclpy.qos import QoSProfile

from collision_monitor import records
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.shapes.registry import Sphere

START = 60.0
MANAGED = ("--ros-args", "-p", "autostart:=false")


def call(team, kind, name, request):
    client = team.node.create_client(kind, f"/object_monitor/{name}")
    assert client.wait_for_service(START)
    future = client.call_async(request)
    team.until(future.done, 20.0)
    team.node.destroy_client(client)
    return future.result()


def change(team, transition, label=""):
    request = ChangeState.Request(transition=Transition(id=transition, label=label))
    return call(team, ChangeState, "change_state", request).success


def state(team):
    return call(team, GetState, "get_state", GetState.Request()).current_state.label


def undocumented(team):
    """Topics and services of the node that docs/node.md does not name; all nodes have /rosout and /parameter_events."""
    page = (Path(__file__).parents[3] / "docs" / "node.md").read_text()
    node = ("object_monitor", "/")
    names = [name for name, _ in team.node.get_publisher_names_and_types_by_node(*node)]
    names += [name for name, _ in team.node.get_subscriber_names_and_types_by_node(*node)]
    services = [name for name, _ in team.node.get_service_names_and_types_by_node(*node)]
    assert len(names) > 8 and len(services) > 9
    documented = page + "`/rosout` `/parameter_events` `~/get_parameter_types` `~/set_parameters_atomically`"
    private = [name.replace("/object_monitor/", "~/") for name in names + services]
    return [name for name in private if f"`{name}`" not in documented]


def approaching():
    rows = np.zeros(2, records.STATE)
    rows["id"], rows["quaternion"][:, 3] = (1, 2), 1.0
    rows["position"][1, 0], rows["linear"][0, 0] = 2.0, 1.0
    return tuple(rows)


def describe(team):
    team.describe(*(ObjectDescription(k, Sphere(0.5)) for k in (1, 2)))


def test_a_manager_takes_it_through_every_state_and_the_recordings_replay(start, team, tmp_path):
    monitor = start("run", "--record", "run.mcap", *MANAGED)
    events = []
    quality = QoSProfile(depth=10)
    team.node.create_subscription(TransitionEvent, "/object_monitor/transition_event", events.append, quality)
    assert state(team) == "unconfigured"
    assert not team.node.count_publishers("/object_monitor/contacts")

    assert change(team, Transition.TRANSITION_CONFIGURE)
    assert state(team) == "inactive"
    team.until(lambda: team.node.count_publishers("/object_monitor/contacts"))
    team.listen(0.3)
    describe(team)
    team.listen(0.3)
    team.say(*approaching())
    team.listen(1.2)  # longer than the period of the status
    assert (team.contacts, team.predictions, team.statuses) == ([], [], [])

    assert change(team, Transition.TRANSITION_ACTIVATE)
    _, predictions = team.ask(*approaching())
    assert len(predictions.predictions) == 1
    assert team.status(lambda s: s.step == 2).objects == 2, "it took the inputs while it was inactive"

    assert change(team, Transition.TRANSITION_DEACTIVATE)
    team.listen(0.2)
    published = len(team.contacts), len(team.statuses)
    team.say(*approaching())
    team.listen(0.7)
    assert (len(team.contacts), len(team.statuses)) == published
    assert "inactive: nothing is published; the inputs are still monitored, recording to run.mcap" in monitor.words

    assert change(team, Transition.TRANSITION_CLEANUP)
    assert state(team) == "unconfigured"
    team.until(lambda: not team.node.count_publishers("/object_monitor/contacts"))
    report = replay(Session(tmp_path / "run.mcap"))
    assert (report.verdict, report.steps) == (Verdict.IDENTICAL, 3), "also the steps of the inactive node"

    assert change(team, Transition.TRANSITION_CONFIGURE)
    assert change(team, Transition.TRANSITION_ACTIVATE)
    team.until(lambda: team.node.count_publishers("/object_monitor/contacts"))
    team.listen(0.3)
    describe(team)
    team.status(lambda s: s.step == 0 and s.objects == 2)
    team.ask(*approaching())
    assert undocumented(team) == []
    assert change(team, Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert state(team) == "finalized"
    assert replay(Session(tmp_path / "run_2.mcap")).verdict is Verdict.IDENTICAL
    assert monitor.stop() == 0
    goals = [event.goal_state.label for event in events if event.goal_state.id <= State.PRIMARY_STATE_FINALIZED]
    assert goals == ["inactive", "active", "inactive", "unconfigured", "inactive", "active", "finalized"]
    assert "Traceback" not in monitor.words


def test_a_transition_in_the_wrong_order_is_refused_and_changes_nothing(start, team):
    monitor = start("run", *MANAGED, "-p", "executor:=events")
    assert not change(team, Transition.TRANSITION_ACTIVATE)
    assert not change(team, 0, "deactivate")
    assert not change(team, 99)
    assert not change(team, 0, "fly")
    assert state(team) == "unconfigured"
    assert "transition 3: expected one from the state unconfigured, configure (1), shutdown (5)" in monitor.words
    assert change(team, 0, "configure")
    assert not change(team, Transition.TRANSITION_CONFIGURE)
    available = call(team, GetAvailableTransitions, "get_available_transitions", GetAvailableTransitions.Request())
    labels = {each.transition.label for each in available.available_transitions}
    assert labels == {"activate", "cleanup", "shutdown"}
    assert change(team, 0, "shutdown")
    assert not change(team, Transition.TRANSITION_CONFIGURE)
    assert "expected one from the state finalized, which has none" in monitor.words
    assert monitor.stop() == 0
    assert "Traceback" not in monitor.words


def memory_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[0]) * resource.getpagesize()


def test_a_transition_that_fails_is_logged_with_its_cause_and_can_be_repeated(start, team):
    """The recorder needs 24 MiB at its start, which the node may not allocate at first; its libraries need less."""
    monitor = start("run", "--record", "run.mcap", *MANAGED)
    assert state(team) == "unconfigured"
    resource.prlimit(monitor.pid, resource.RLIMIT_AS, (memory_of(monitor.pid) + (20 << 20), resource.RLIM_INFINITY))
    assert not change(team, Transition.TRANSITION_CONFIGURE)
    resource.prlimit(monitor.pid, resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    assert state(team) == "unconfigured"
    assert "configure failed: MemoryError()" in monitor.words
    assert "Remove the cause, then configure it again" in monitor.words
    assert change(team, Transition.TRANSITION_CONFIGURE)
    assert change(team, Transition.TRANSITION_ACTIVATE)
    team.meet()
    describe(team)
    team.status(lambda s: s.objects == 2)
    assert len(team.ask(*approaching())[1].predictions) == 1
    assert monitor.stop() == 0
