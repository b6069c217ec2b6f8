"""The node as a team of robots uses it: another process, real DDS, messages read by rclpy."""

import math
import signal
import time

import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import Marker, MarkerArray

from collision_monitor import codec, records
from collision_monitor.accuracy.reference_monitor import ReferenceMonitor
from collision_monitor.codec import Removal
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros import executables
from collision_monitor.ros.endpoints import quality_of
from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.world import make_scene
from collision_monitor_msgs.msg import Contact, MonitorStatus

BALL = ((Sphere(0.5), Pose()),)
SECOND = 1_000_000_000


def ball(object_id, **options):
    return ObjectDescription(object_id, BALL, name=f"ball {object_id}", **options)


def state(object_id, position, linear=(0, 0, 0)):
    row = np.zeros((), records.STATE)
    row["id"], row["position"], row["linear"] = object_id, position, linear
    row["quaternion"] = (0, 0, 0, 1)
    return row


APPROACHING = (state(1, (0, 0, 0), (1, 0, 0)), state(2, (2, 0, 0)))
"""Two balls with 1 m between them, closing at 1 m/s: they touch in 1 s."""
OVERLAPPING = (state(3, (0, 10, 0)), state(4, (0.9, 10, 0)))
"""Two balls that overlap by 0.1 m."""
LYING = (state(5, (20, 0, 0)), state(6, (20.5, 0.5, 0.95)))
"""Two cubes of 1 m. One is 5 cm deep in the upper face of the other and covers a quarter of it."""


def call(team, kind, name, request):
    client = team.node.create_client(kind, f"/object_monitor/{name}")
    assert client.wait_for_service(10.0)
    future = client.call_async(request)
    team.until(future.done)
    return future.result()


def set_parameter(team, name, value):
    """Return why the parameter was refused; empty if it was not."""
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    (result,) = call(team, SetParameters, "set_parameters", request).results
    return "" if result.successful else result.reason


def test_a_known_contact_and_a_known_impact(start, team):
    monitor = start("run")
    team.meet()
    team.describe(*map(ball, (1, 2, 3, 4)))
    team.status(lambda s: s.objects == 4)
    contacts, predictions = team.ask(*APPROACHING, *OVERLAPPING)

    (contact,) = contacts.contacts
    assert (contact.id_a, contact.id_b) == (3, 4)
    assert contact.signed_distance == pytest.approx(-0.1, abs=1e-9)
    assert (contact.normal.x, contact.normal.y, contact.normal.z) == pytest.approx((1, 0, 0))
    assert contact.phase == Contact.BEGIN
    assert (list(contacts.ids), contacts.names) == ([3, 4], ["ball 3", "ball 4"])

    (impact,) = predictions.predictions
    assert (impact.id_a, impact.id_b) == (1, 2)
    assert impact.lower <= 1.0 <= impact.upper
    assert impact.upper - impact.lower < 0.02
    assert impact.closing_speed == pytest.approx(1.0)
    assert (list(predictions.ids), predictions.names) == ([1, 2], ["ball 1", "ball 2"])
    assert (contacts.header.frame_id, contacts.step, predictions.horizon) == ("world", 1, 2.0)

    status = team.status(lambda s: s.step == 1)
    assert (status.contacts, status.predictions, status.objects) == (1, 1, 4)
    assert 0.0 < status.latency < 5.0
    assert 0.0 < status.step_duration < 5.0
    assert status.recording == MonitorStatus.RECORDING_OFF
    assert monitor.stop() == 0
    assert "Traceback" not in monitor.words


def test_shapes_that_were_published_before_the_monitor_started_are_known(start, team):
    team.describe(ball(1), ball(2))
    start("run")
    team.meet()
    team.status(lambda s: s.objects == 2)
    _, predictions = team.ask(*APPROACHING)
    assert len(predictions.predictions) == 1


def _refused(team, field):
    return team.status(lambda s: getattr(s, field) == 1)


def test_bad_input_is_counted_and_the_others_are_still_monitored(start, team):
    monitor = start("run")
    team.meet()
    team.describe(ball(1), ball(2), ball(5))
    team.status(lambda s: s.objects == 3)

    nan, lying, stranger = state(5, (math.nan, 0, 0)), state(5, (50, 0, 0)), state(77, (0, 0, 0))
    lying["quaternion"] = 0.0
    for bad, field in ((nan, "non_finite"), (lying, "quaternion"), (stranger, "unknown_id")):
        _, predictions = team.ask(*APPROACHING, bad)
        assert [(p.id_a, p.id_b) for p in predictions.predictions] == [(1, 2)]
        assert _refused(team, f"refused_{field}").last_refusal

    # The empty message is left out, because Fast DDS never delivers it.
    for garbage in (b"\x00", b"\x00\x01\x00\x00", b"\xff" * 7, bytes(range(256)) * 4):
        team.publish_states(garbage)
        team.publish_shapes(garbage)
    team.status(lambda s: s.refused_malformed == 8)

    stamp = team.say(*APPROACHING, stamp=team.now)
    team.status(lambda s: s.step == 4)
    team.say(*APPROACHING, stamp=stamp - SECOND // 100)
    assert team.status(lambda s: s.refused_old == 2).objects == 3
    team.say(*APPROACHING, frame_id="moon")
    _refused(team, "refused_frame")
    team.say(*APPROACHING, stamp=team.now + 3600 * SECOND)
    _refused(team, "refused_time")

    _, predictions = team.ask(*APPROACHING)
    assert len(predictions.predictions) == 1
    team.describe(Removal(5))
    team.ask(*APPROACHING, state(5, (0.5, 0, 0)))
    status = team.status(lambda s: s.refused_unknown_id == 2)
    assert status.objects == 2
    assert monitor.stop() == 0


def test_an_impossible_shape_is_refused_and_the_others_are_taken(start, team):
    start("run")
    team.meet()
    data = bytearray(_encoded(ball(1), ball(2)))
    radius = np.float64(0.5).tobytes()
    first = bytes(data).index(radius)
    data[first : first + 8] = np.float64(-0.5).tobytes()
    team.publish_shapes(bytes(data))
    status = _refused(team, "refused_shape")
    assert status.objects == 1
    assert "-0.5" in status.last_refusal


def _encoded(*objects):
    return codec.encode_descriptions(0, "world", objects)


def test_silence_is_never_clear(start, team):
    start("run", "--ros-args", "-p", "stale_after:=0.3")
    team.meet()
    team.describe(ball(1), ball(2), ball(3))
    team.status(lambda s: s.objects == 3)
    team.ask(*APPROACHING)
    status = team.status(lambda s: s.objects_stale == 2)
    assert (status.objects_unseen, status.predictions) == (1, 1)
    received = len(team.statuses)
    team.until(lambda: len(team.statuses) - received >= 2)
    assert team.statuses[-1].rate == 0.0
    assert team.statuses[-1].step == 1


def test_simulated_time(start, team):
    """The simulated clock starts an hour after the epoch, and the latency is by that clock."""
    start("run", "--ros-args", "-p", "use_sim_time:=true")
    team.meet()
    clock = team.node.create_publisher(Clock, "/clock", 10)
    team.until(lambda: clock.get_subscription_count())
    team.describe(ball(1), ball(2))
    team.status(lambda s: s.objects == 2)
    message = Clock()
    message.clock.sec, message.clock.nanosec = 3600, 250_000_000
    clock.publish(message)
    assert clock.wait_for_all_acked(Duration(seconds=10))
    team.listen(0.3)
    team.ask(*APPROACHING, stamp=3600 * SECOND)
    assert team.status(lambda s: s.step == 1).latency == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-p", "horizon:=-1.0"], "horizon: expected 0 to 1e+06 s, got -1"),
        (["-p", "horizn:=1.0"], "did you mean 'horizon'?"),
        (["-p", "threads:=1.5"], "threads: expected a whole number, got 1.5"),
        (["-p", "profile:=hasty"], "expected one of balanced, exact, fast, or a .yaml file, got 'hasty'"),
        (["-p", "executor:=none"], "expected single or events, got 'none'"),
        (["-p", "frame_id:=''"], "expected the name of a frame, got an empty text"),
    ],
)
def test_impossible_parameters_are_refused_in_one_line(ros_domain_id, signals, capfd, arguments, words):
    assert executables.monitor(["monitor", "--ros-args", *arguments]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert words in line


def test_settings_change_while_it_runs_and_the_session_replays(start, team, tmp_path):
    monitor = start("run", "--record", "run.mcap", "--ros-args", "-p", "horizon:=1")
    team.meet()

    def change(name, value):
        return set_parameter(team, name, value)

    def values(*names):
        found = call(team, GetParameters, "get_parameters", GetParameters.Request(names=names)).values
        return [value.string_value or value.double_value for value in found]

    cubes = [ObjectDescription(k, ((Box((1, 1, 1)), Pose()),), name=f"cube {k}") for k in (5, 6)]
    team.describe(*map(ball, (1, 2, 3, 4)), *cubes)
    team.status(lambda s: s.objects == 6)
    first, _ = team.ask(*APPROACHING, *OVERLAPPING)
    assert change("horizon", 3) == "", "a whole number is taken where a decimal one is meant"
    assert change("profile", "fast") == ""
    contacts, predictions = team.ask(*APPROACHING, *OVERLAPPING)
    assert [contact.phase for contact in (*first.contacts, *contacts.contacts)] == [Contact.BEGIN, Contact.PERSIST]
    assert predictions.horizon == 3.0
    assert predictions.predictions[0].upper - predictions.predictions[0].lower < 0.2
    assert values("profile", "horizon", "position_tolerance") == ["fast", 3.0, 0.05]

    (tmp_path / "site.yaml").write_text("based_on: exact\nhorizon: 4.0\n")
    assert change("profile", "site.yaml") == ""
    assert values("horizon", "position_tolerance") == [4.0, 1e-9]
    assert "expected one of balanced, exact, fast" in change("profile", "hasty")
    assert "out of range" in change("horizon", -1.0)
    assert "read-only" in change("frame_id", "map")
    assert "read-only" in change("record", "other.mcap")
    assert values("profile", "horizon", "frame_id") == ["site.yaml", 4.0, "world"]
    _, predictions = team.ask(*APPROACHING)
    assert predictions.horizon == 4.0
    assert predictions.predictions[0].upper - predictions.predictions[0].lower < 1e-4

    corners = []
    for most in (1, 4):
        assert change("contact_points", most) == ""
        contacts, _ = team.ask(*LYING)
        rows = [row for row in contacts.contacts if row.id_a == 5]
        corners.append(sorted((round(p.x, 9), round(p.y, 9), round(p.z, 9)) for p in (row.point_a for row in rows)))
        assert {row.point_count for row in rows} == {most}
    assert corners[1] == [(20.0, 0.0, 0.5), (20.0, 0.5, 0.5), (20.5, 0.0, 0.5), (20.5, 0.5, 0.5)]
    assert team.status(lambda s: s.step == 5).contacts == 2
    assert "out of range" in change("contact_points", 5)

    assert change("model_primitive", "kdop14") == ""
    assert "expected one of" in change("model_primitive", "potato")
    contacts, _ = team.ask(*LYING)
    assert {(row.model_a, row.model_b, row.phase) for row in contacts.contacts if row.id_a == 5} == {
        (int(records.Model.KDOP14), int(records.Model.KDOP14), Contact.PERSIST)
    }

    assert monitor.stop() == 0
    assert "Traceback" not in monitor.words
    report = replay(Session(tmp_path / "run.mcap"))
    assert (report.verdict, report.steps, report.notes) == (Verdict.IDENTICAL, 6, [])


@pytest.mark.parametrize("executor", ["single", "events"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_cleanly_idle_and_under_load(start, team, tmp_path, number, executor):
    monitor = start("run", "--record", "run.mcap", "--ros-args", "-p", f"executor:={executor}")
    team.meet()
    if executor == "single":  # under load: messages keep arriving while it stops
        team.describe(ball(1), ball(2))
        timer = team.node.create_timer(0.001, lambda: team.say(*APPROACHING))
        team.status(lambda s: s.step > 20)
    monitor.send(number)
    monitor.send(number)
    team.until(lambda: not monitor.running)
    if executor == "single":
        team.node.destroy_timer(timer)
    assert monitor.wait() == 0
    assert "Traceback" not in monitor.words
    assert (tmp_path / "run.mcap").read_bytes().endswith(b"\x89MCAP0\r\n")


def test_markers_are_drawn_for_whoever_looks(start, team):
    start("run")
    team.meet()
    pictures = []
    team.node.create_subscription(MarkerArray, "/object_monitor/markers", pictures.append, quality_of(Topic.MARKERS))
    team.describe(*map(ball, (1, 2, 3, 4)), ball(5), ObjectDescription(6, BALL, static=True, pose=Pose((0, -9, 0))))
    team.status(lambda s: s.objects == 6)
    timer = team.node.create_timer(0.05, lambda: team.say(*APPROACHING, *OVERLAPPING, state(5, (50, 0, 0))))
    team.until(lambda: pictures)
    team.node.destroy_timer(timer)
    by_name = {marker.ns: marker for marker in pictures[-1].markers if marker.action == Marker.ADD}
    assert {"static", "clear", "contact points", "contact normals", "predicted impacts"} < by_name.keys()
    assert {round(p.x) for p in by_name["clear"].points} <= {49, 50, 51}
    assert {round(p.y) for p in by_name["touching"].points} <= {9, 10, 11}
    assert {round(p.y) for p in by_name["static"].points} <= {-10, -9, -8}
    assert by_name["predicted impacts"].points[0].x == pytest.approx(1.5, abs=0.05)
    assert {round(p.y) for p in by_name["predicted"].points} <= {-1, 0, 1}
    assert by_name["time left"].text in ("0.98 s", "0.99 s", "1.00 s")


def test_a_signal_ends_it_while_the_kernels_compile(start, monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "empty"))
    monitor = start("run")
    deadline = time.monotonic() + 60.0
    while "compiling the kernels" not in monitor.words:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    assert monitor.stop(signal.SIGTERM) == 0
    assert "Traceback" not in monitor.words


def test_a_budget_that_is_too_small_leaves_pairs_unresolved_and_none_clear(start, team, tmp_path):
    """Every body takes another course in each message, so a step takes milliseconds; its budget is 50 microseconds."""
    monitor = start("run", "--record", "run.mcap", "--ros-args", "-p", "budget_ms:=0.05")
    scene, truth, random = make_scene("clutter", objects=300), ReferenceMonitor(), np.random.default_rng(6)
    for description in scene.descriptions:
        truth.describe(description)
    team.meet()
    team.describe(*scene.descriptions)
    team.status(lambda s: s.objects == 300)

    def ask():
        states = scene.step()
        states["linear"] += random.uniform(-0.3, 0.3, states["linear"].shape)
        stamp = team.now
        contacts, predictions = team.ask(*states, stamp=stamp)
        found = truth.step(stamp, states)
        status = team.status(lambda s: s.step == contacts.step)
        reported = {(c.id_a, c.id_b): c for c in contacts.contacts if c.phase != Contact.END}
        stated = {(p.id_a, p.id_b): p for p in predictions.predictions}
        assert _pairs(found.contacts[found.contacts["phase"] != records.Phase.END]) <= reported.keys() | stated.keys()
        for row in found.contacts[found.contacts["phase"] != records.Phase.END]:
            if (mine := reported.get((int(row["id_a"]), int(row["id_b"])))) is not None:
                assert abs(mine.signed_distance - row["signed_distance"]) <= mine.error_bound + 1e-9
        for row in found.predictions[found.predictions["status"] == records.PredictionStatus.HIT]:
            mine = stated.get((int(row["id_a"]), int(row["id_b"])))
            assert mine is not None or row["upper"] >= 2.0 or (row["id_a"], row["id_b"]) in reported
            assert mine is None or (mine.lower <= row["upper"] and row["lower"] <= mine.upper)
        bounds = [p for p in stated.values() if p.method == records.Method.BOUND]
        assert {p.status for p in bounds} <= {int(records.PredictionStatus.UNRESOLVED)}
        return status, len(bounds), len(stated.keys() - _pairs(found.predictions))

    for _ in range(5):
        status, bounds, _ = ask()
        assert status.deferred > 0 and bounds > 0
        assert status.unresolved >= bounds
    assert "expected 0.05 to" in (reason := set_parameter(team, "budget_ms", 0.0)) or "out of range" in reason
    assert set_parameter(team, "budget_ms", 1e6) == ""
    status, bounds, beyond = ask()
    assert (status.deferred, bounds) == (0, 0)
    assert beyond < 20, "near misses, within the tolerance of the motion"
    assert set_parameter(team, "budget_ms", 0.05) == ""
    assert ask()[0].deferred > 0

    assert monitor.stop() == 0
    assert "Traceback" not in monitor.words
    report = replay(Session(tmp_path / "run.mcap"))
    assert (report.verdict, report.steps, report.notes) == (Verdict.IDENTICAL, 7, [])


def _pairs(rows):
    return {(int(row["id_a"]), int(row["id_b"])) for row in rows}
