"""Replay: identical, diverged and not comparable; and the command's exit codes."""

from __future__ import annotations

import json
import resource
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
from session_scene import CONTACTS, PREDICTIONS, STATES, STATUS, TYPES, record
from started_threads import StartedThreads

from collision_monitor.cli.main import main
from collision_monitor.codec import decode_contacts, decode_status, encode_contacts, encode_status
from collision_monitor.errors import SessionError
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.session import Recorded, Recorder, Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict


def rewritten(
    source: Path,
    target: Path,
    change: Callable[[Recorded], bytes | None] = lambda message: message.data,
    **metadata: str,
) -> Path:
    """Copy a session, message by message; None leaves a message out and keeps the numbering without a gap."""
    session = Session(source)
    with Recorder(target, TYPES, {**session.metadata, **metadata}) as recorder:
        for message in session.messages():
            data = change(message)
            if data is not None:
                recorder.write(message.topic, data, message.log_time, message.publish_time)
    return target


def step_of(message: Recorded) -> int:
    return decode_contacts(message.data).step


@pytest.mark.parametrize("threads", [None, 1, 2])
def test_a_replay_gives_the_same_bytes(recorded: Path, threads: int | None, started_threads: StartedThreads) -> None:
    report = replay(Session(recorded), threads=threads)
    assert started_threads.most == (2 if threads == 2 else 0)
    assert (report.verdict, report.first_difference, report.notes) == (Verdict.IDENTICAL, None, [])
    assert report.steps == 50
    assert report.compared == 50 + 50 + 11  # contacts, predictions, statuses
    last = [m for m in Session(recorded).messages() if m.topic == STATUS][-1]
    assert report.digest == decode_status(last.data).digest != 0


def test_one_changed_bit_in_a_contact_is_found_and_named(recorded: Path, tmp_path: Path) -> None:
    changed: list[tuple[int, str]] = []

    def change(message: Recorded) -> bytes:
        if message.topic != CONTACTS or changed:
            return message.data
        contacts = decode_contacts(message.data)
        if contacts.step < 20 or not len(contacts.contacts):
            return message.data
        row = contacts.contacts[0]
        changed.append((contacts.step, f"pair ({row['id_a']} 'body {row['id_a']}', {row['id_b']}"))
        at = message.data.index(contacts.contacts[0].tobytes())
        speed = float(row["closing_speed"])
        other = struct.pack("<d", speed + 1.0)
        return message.data[: at + 88] + other + message.data[at + 96 :]

    report = replay(Session(rewritten(recorded, tmp_path / "a.mcap", change)))
    assert report.verdict is Verdict.DIVERGED
    assert report.differing == 1
    difference = report.first_difference
    assert difference is not None
    ((step, pair),) = changed
    assert (difference.step, difference.topic, difference.field) == (step, CONTACTS, "closing_speed")
    assert pair in difference.element
    assert float(difference.recorded) == pytest.approx(float(difference.replayed) + 1.0)


def test_a_changed_input_is_found_in_the_answers(recorded: Path, tmp_path: Path) -> None:
    def change(message: Recorded) -> bytes:
        if message.topic == STATES and message.sequence > 60 and message.data.count(b"world"):
            return message.data.replace(struct.pack("<d", 0.3), struct.pack("<d", 0.4))
        return message.data

    report = replay(Session(rewritten(recorded, tmp_path / "a.mcap", change)))
    assert report.verdict is Verdict.DIVERGED
    assert report.differing > 5


@pytest.mark.parametrize("topic", [CONTACTS, PREDICTIONS])
def test_a_missing_answer_is_a_difference(recorded: Path, tmp_path: Path, topic: str) -> None:
    left_out: list[int] = []

    def change(message: Recorded) -> bytes | None:
        if message.topic == topic and len(left_out) == 0 and message.sequence > 50:
            left_out.append(message.sequence)
            return None
        return message.data

    report = replay(Session(rewritten(recorded, tmp_path / "a.mcap", change)))
    assert report.verdict is Verdict.DIVERGED
    assert report.first_difference is not None
    assert (report.first_difference.field, report.first_difference.recorded) == ("presence", "nothing")


def test_messages_out_of_order_are_reported(recorded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    messages = list(Session(recorded).messages())
    session = Session(recorded)
    turned = [*messages[:60], *messages[62:64], *messages[60:62], *messages[64:]]
    monkeypatch.setattr(session, "entries", lambda place=None: iter(turned))
    report = replay(session)
    assert (report.verdict, report.hole, report.first_difference) == (Verdict.NOT_COMPARABLE, True, None)
    assert report.notes[0].startswith("2 messages are missing after step 1")
    backwards = [*messages[:60], *messages[40:]]
    monkeypatch.setattr(session, "entries", lambda place=None: iter(backwards))
    report = replay(session)
    assert report.verdict is Verdict.NOT_COMPARABLE
    assert "not in the order of their recording: message 40 follows message 59" in report.notes[0]
    assert report.recorded_duration == (messages[59].log_time - messages[0].log_time) * 1e-9
    late = [message._replace(log_time=message.log_time - 10**9 * (message.sequence == 50)) for message in messages]
    monkeypatch.setattr(session, "entries", lambda place=None: iter(late))
    report = replay(session)
    assert report.notes == ["1 messages are older than one before them: taken in the order of the file"]
    assert report.recorded_duration == (messages[-1].log_time - messages[0].log_time) * 1e-9


def test_an_answer_too_many_is_a_difference(recorded: Path, tmp_path: Path) -> None:
    session = Session(recorded)
    with Recorder(tmp_path / "a.mcap", TYPES, session.metadata) as recorder:
        for message in session.messages():
            for _ in range(2 if message.topic == CONTACTS and message.sequence > 30 else 1):
                recorder.write(message.topic, message.data, message.log_time, message.publish_time)
    report = replay(Session(tmp_path / "a.mcap"))
    assert report.verdict is Verdict.DIVERGED
    assert report.first_difference is not None
    assert report.first_difference.replayed == "nothing"


def test_a_wrong_counter_in_a_status_is_a_difference_and_live_fields_are_not(recorded: Path, tmp_path: Path) -> None:
    from dataclasses import replace

    def live(message: Recorded) -> bytes:
        if message.topic != STATUS:
            return message.data
        status = decode_status(message.data)
        silent = status.objects - status.objects_static - status.objects_unseen
        return encode_status(replace(status, rate=7.0, recorded_bytes=99, recording_path="/x", objects_stale=silent))

    assert replay(Session(rewritten(recorded, tmp_path / "live.mcap", live))).verdict is Verdict.IDENTICAL

    def wrong(message: Recorded) -> bytes:
        if message.topic != STATUS or message.sequence < 50:
            return message.data
        return encode_status(replace(decode_status(message.data), refused_frame=17))

    report = replay(Session(rewritten(recorded, tmp_path / "wrong.mcap", wrong)))
    assert report.first_difference is not None
    assert (report.first_difference.field, report.first_difference.recorded) == ("refused_frame", "17")


def test_another_version_is_not_comparable_unless_the_bytes_are_equal(recorded: Path, tmp_path: Path) -> None:
    old = {"version": "0.0.9", "determinism_key": "another"}
    report = replay(Session(rewritten(recorded, tmp_path / "equal.mcap", **old)))
    assert report.verdict is Verdict.IDENTICAL
    assert "version 0.0.9 (here " in report.notes[0]

    def change(message: Recorded) -> bytes:
        return message.data[:-1] + b"x" if message.topic == CONTACTS and step_of(message) == 20 else message.data

    report = replay(Session(rewritten(recorded, tmp_path / "other.mcap", change, **old)))
    assert report.verdict is Verdict.NOT_COMPARABLE
    assert report.first_difference is not None


def test_dropped_messages_end_the_comparison(recorded: Path, tmp_path: Path) -> None:
    session = Session(recorded)
    recorder = Recorder(tmp_path / "a.mcap", TYPES, session.metadata)
    for message in session.messages():
        if message.sequence == 80:
            recorder._next_sequence += 3  # like three messages that were dropped
        recorder.write(message.topic, message.data, message.log_time, message.publish_time)
    recorder.close()
    report = replay(Session(tmp_path / "a.mcap"))
    assert report.verdict is Verdict.NOT_COMPARABLE
    assert report.first_difference is None
    assert "3 messages are missing after step" in report.notes[0]


@pytest.mark.parametrize("cut", [1, 100, 2000])
def test_a_cut_session_compares_what_is_there_and_says_so(recorded: Path, tmp_path: Path, cut: int) -> None:
    """The file has no summary, and its last bytes are cut off as well."""
    recorder = record(tmp_path / "a.mcap", close=False)
    import time

    time.sleep(0.6)
    data = (tmp_path / "a.mcap").read_bytes()
    recorder.close()
    (tmp_path / "cut.mcap").write_bytes(data[:-cut] + b"")
    session = Session(tmp_path / "cut.mcap")
    if not list(session.messages()):
        with pytest.raises(SessionError, match="expected object states"):
            replay(session)
        return
    report = replay(session)
    assert report.verdict is Verdict.IDENTICAL
    assert "cut off" in " ".join(report.notes)


def test_a_session_of_inputs_alone_has_nothing_to_compare(recorded: Path, tmp_path: Path) -> None:
    path = rewritten(recorded, tmp_path / "a.mcap", lambda m: m.data if "objects" in m.topic else None)
    report = replay(Session(path))
    assert report.verdict is Verdict.NOT_COMPARABLE
    assert report.notes == ["the session holds no answers to compare with"]
    assert report.digest == replay(Session(recorded)).digest


def test_a_session_without_inputs_says_what_it_holds(recorded: Path, tmp_path: Path) -> None:
    path = rewritten(recorded, tmp_path / "a.mcap", lambda m: m.data if m.topic == STATUS and m.sequence < 9 else None)
    with pytest.raises(SessionError, match=f"expected object states and shapes, found {STATUS}"):
        replay(Session(path))
    Recorder(tmp_path / "empty.mcap", TYPES, Pipeline().metadata()).close()
    with pytest.raises(SessionError, match="found no messages at all"):
        replay(Session(tmp_path / "empty.mcap"))


def test_the_command_names_the_verdict_and_exits_with_it(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(recorded)]) == 0
    out = capsys.readouterr()
    assert "verdict    identical" in out.out
    assert out.err == ""

    def change(message: Recorded) -> bytes:
        return message.data[:-1] + b"x" if message.topic == CONTACTS and step_of(message) == 20 else message.data

    other = rewritten(recorded, tmp_path / "other.mcap", change)
    assert main(["replay", str(other)]) == 3
    assert "different  step 20, /object_monitor/contacts" in capsys.readouterr().out
    assert main(["replay", str(other), "--json"]) == 3
    result = json.loads(capsys.readouterr().out)
    assert (result["verdict"], result["first_difference"]["step"], result["steps"]) == ("diverged", 20, 50)
    foreign = rewritten(other, tmp_path / "foreign.mcap", determinism_key="x")
    assert main(["replay", str(foreign)]) == 4
    capsys.readouterr()
    assert main(["replay", str(tmp_path / "none.mcap")]) == 1
    err = capsys.readouterr().err
    assert "expected a session file" in err
    assert "Traceback" not in err
    assert main(["replay", str(recorded), "--threads", "0"]) == 2
    assert "threads: expected 1 to" in capsys.readouterr().err


def nudged(recorded: Path, tmp_path: Path, by: float) -> Path:
    """Return the session with each contact a little deeper."""

    def change(message: Recorded) -> bytes:
        if message.topic != CONTACTS:
            return message.data
        contacts = decode_contacts(message.data)
        rows = contacts.contacts.copy()
        rows["signed_distance"] -= by
        return encode_contacts(contacts.stamp_ns, contacts.frame_id, contacts.step, rows, contacts.ids, contacts.names)

    return rewritten(recorded, tmp_path / "nudged.mcap", change)


def test_within_a_tolerance_answers_are_equal_and_beyond_they_are_not(recorded: Path, tmp_path: Path) -> None:
    path = nudged(recorded, tmp_path, 1e-7)
    assert replay(Session(path)).verdict is Verdict.DIVERGED
    near = replay(Session(path), tolerance=1e-6)
    assert near.verdict is Verdict.IDENTICAL
    assert near.within > 30
    far = replay(Session(path), tolerance=1e-8)
    assert far.verdict is Verdict.DIVERGED
    assert far.first_difference is not None and far.first_difference.field == "signed_distance"


def test_a_difference_comes_with_its_inputs_and_can_be_cut_out(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def change(message: Recorded) -> bytes:
        if message.topic == CONTACTS and step_of(message) == 12:
            contacts = decode_contacts(message.data)
            rows = contacts.contacts.copy()
            rows["signed_distance"][0] += 0.5
            return encode_contacts(
                contacts.stamp_ns, contacts.frame_id, contacts.step, rows, contacts.ids, contacts.names
            )
        return message.data

    path = rewritten(recorded, tmp_path / "changed.mcap", change)
    out = tmp_path / "cut.mcap"
    assert main(["replay", str(path), "--cut", str(out)]) == Verdict.DIVERGED
    text = capsys.readouterr().out
    assert "different  step 12" in text
    assert text.count("input      object ") == 2
    assert "position [" in text
    whole, part = (replay(Session(each)) for each in (path, out))
    assert part.first_difference == whole.first_difference
    assert part.steps == 12
    assert part.messages == whole.first_message + 1
    assert main(["replay", str(path), "--cut", str(out)]) == 1  # the file exists already
    assert main(["replay", str(path), "--cut", str(out), "--force"]) == Verdict.DIVERGED
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    capsys.readouterr()
    for size in (2_000, out.stat().st_size - 1_000):  # the beginning does not fit on the disk, or the end
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        try:
            code = main(["replay", str(path), "--cut", str(tmp_path / "b.mcap")])
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert code == 1
        assert "expected to be able to write there, got: File too large" in capsys.readouterr().err
        assert not (tmp_path / "b.mcap").exists()
