"""Snapshots in a session: a replay from each of them, and of each file of a split recording, gives the same bytes as
one from the start.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader
from session_scene import CONTACTS, STEP, record
from started_threads import threads_start

from collision_monitor.cli.main import main
from collision_monitor.codec import decode_contacts, encode_contacts
from collision_monitor.errors import InputError, SessionError
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.session import Recorded, Session, Splitting
from collision_monitor.session.mcap.definitions import definition
from collision_monitor.session.mcap.rosbag2 import full_name
from collision_monitor.session.mcap.salvage import salvage
from collision_monitor.session.reader import RecordedSnapshot
from collision_monitor.session.recording import recorder, recording_files
from collision_monitor.session.recording.event_window import EventWindow
from collision_monitor.session.recording.queue_entry import QueueEntry
from collision_monitor.session.recording.session_file import SessionFile
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.settings.profile import Profile

LENGTH = 0.54
"""s: 50 steps and the other messages between them."""


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Record a snapshot every 0.1 s, however small the session."""
    for module in (recording_files, recorder):
        monkeypatch.setattr(module, "SNAPSHOT_PERIOD", 0.1)
    monkeypatch.setattr(recorder, "EVENT_SNAPSHOT_PERIODS", (0.02, 0.02))
    monkeypatch.setattr(recording_files, "SNAPSHOT_SHARE", 1e9)


@pytest.fixture
def path(tmp_path: Path, often: None) -> Path:
    record(tmp_path / "run.mcap", snapshots=True)
    return tmp_path / "run.mcap"


def test_from_every_snapshot_the_answers_are_those_of_the_whole(path: Path, recorded: Path) -> None:
    session = Session(path)
    assert list(session.messages()) == list(Session(recorded).messages()), "snapshots are no messages"
    timeline = session.timeline()
    assert len(timeline.snapshots) == 5
    assert (timeline.end - timeline.begin) * 1e-9 == pytest.approx(LENGTH, abs=0.02)
    whole = replay(Session(path))
    assert (whole.verdict, whole.notes) == (Verdict.IDENTICAL, [])
    for place in timeline.snapshots:
        start = (place.log_time - timeline.begin) * 1e-9 + 1e-6
        for threads in (1, 2):
            with threads_start() as started:
                report = replay(Session(path), start=start, threads=threads)
            assert started.most == (threads if threads > 1 else 0)
            assert report.verdict is Verdict.IDENTICAL
            assert report.begin == pytest.approx(start - 1e-6)
            assert (report.digest, report.steps) == (whole.digest, whole.steps)
            assert report.messages == whole.messages - place.sequence


def test_the_command_begins_at_the_last_snapshot(
    path: Path, recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(path), "--from", "0.35"]) == 0
    text = capsys.readouterr().out
    assert "from       0.3" in text and "note       compared from the snapshot in step 2" in text
    assert main(["replay", str(path), "--from", "0.35", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["begin"] == pytest.approx(0.31, abs=0.015)
    assert main(["replay", str(path), "--from", "0.05"]) == 0
    assert "no snapshot in the first 0.05 s: replayed from the start" in capsys.readouterr().out
    assert main(["replay", str(recorded), "--from", "0.35"]) == 0
    assert "no snapshot in the first 0.35 s" in capsys.readouterr().out
    assert main(["replay", str(path), "--from", "7"]) == 1
    assert "expected a time from 0 to 0.5" in capsys.readouterr().err
    for wrong in ("-1", "nan", "soon"):
        with pytest.raises(SystemExit, match="2"):
            main(["replay", str(path), "--from", wrong])
        assert f"expected a number, at least 0, got '{wrong}'" in capsys.readouterr().err
    with pytest.raises(InputError):
        replay(Session(path), start=-1.0)


def test_the_mcap_library_finds_them_in_the_index(path: Path) -> None:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        found = list(reader.iter_attachments())
    assert summary.statistics.attachment_count == len(found) == len(summary.attachment_indexes) == 5
    assert found[0].name.startswith("snapshot_before_")
    assert Snapshot.decode(found[0].data).facts["monitor"]["step"] > 0


@pytest.mark.parametrize("times", [[0, 0, 0], [0, 5], [7, 9, 12], []])
def test_a_timeline_may_begin_at_zero(tmp_path: Path, times: list[int]) -> None:
    with recorder.Recorder(tmp_path / "a.mcap", {"/x": "ContactArray"}, {"profile": "{}", "frame_id": ""}) as writing:
        for time in times:
            writing.write("/x", b"", time, time)
    timeline = Session(tmp_path / "a.mcap").timeline()
    assert (timeline.begin, timeline.end) == (min(times, default=0), max(times, default=0))


def test_quiet_sessions_have_few_snapshots(tmp_path: Path, often: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_files, "SNAPSHOT_SHARE", 0.05)
    record(tmp_path / "run.mcap", snapshots=True)
    data = [each.data for each in Session(tmp_path / "run.mcap").entries() if isinstance(each, RecordedSnapshot)]
    assert len(data) == 1, "the first snapshot is written at once"


def test_rates_of_classes_replay_from_the_middle(tmp_path: Path, often: None) -> None:
    """Which state of a class is used next depends on the last one that was used, before the snapshot."""
    classes = Profile(horizon_by_name="body 1=0.5, wall=1", rate_by_name="body [123]=15, body*=37")
    record(tmp_path / "run", splitting=Splitting(size=1), snapshots=True, pipeline=Pipeline(classes))
    record(tmp_path / "plain.mcap")
    digests = [replay(Session(tmp_path / name)).digest for name in ("run", "plain.mcap")]
    assert digests[0] != digests[1], "the classes matter"
    files = sorted((tmp_path / "run").glob("*.mcap"))
    assert len(files) > 2
    for path in files:
        report = replay(Session(path))
        assert (report.verdict, report.late) == (Verdict.IDENTICAL, False)


@pytest.mark.parametrize("splitting", [Splitting(duration=0.2), Splitting(size=1)])
def test_each_file_of_a_recording_in_several_replays_alone(
    recorded: Path, tmp_path: Path, often: None, splitting: Splitting
) -> None:
    record(tmp_path / "run", splitting=splitting, snapshots=True)
    files = sorted((tmp_path / "run").glob("*.mcap"), key=lambda path: int(path.stem.split("_")[1]))
    assert len(files) > 1
    session = Session(tmp_path / "run")
    assert list(session.messages()) == list(Session(recorded).messages())
    assert replay(session).verdict is Verdict.IDENTICAL
    steps = 0
    for k, path in enumerate(files):
        report = replay(Session(path))
        assert (report.verdict, report.late, report.hole) == (Verdict.IDENTICAL, False, False)
        assert report.notes == [] if k == 0 else "with a snapshot in step" in report.notes[0]
        assert report.steps >= steps
        steps = report.steps
    assert steps == 50
    start = replay(Session(tmp_path / "run"), start=0.4)
    assert start.verdict is Verdict.IDENTICAL and start.begin > 0.1
    (tmp_path / "run" / files[1].name).unlink()
    gap = replay(Session(tmp_path / "run"))
    assert gap.verdict is Verdict.IDENTICAL, "the messages that are there were compared, the missing ones reported"
    assert "messages are missing after step" in gap.notes[0] and f"{files[1].name} is not there" in gap.notes


def test_each_window_of_a_recording_on_events_replays_alone(recorded: Path, tmp_path: Path, often: None) -> None:
    window = Splitting(on_event=True, before=0.02, after=0.01)
    record(tmp_path / "run", splitting=window, snapshots=True)
    files = sorted((tmp_path / "run").glob("*.mcap"))
    assert len(files) > 1
    whole = list(Session(recorded).messages())
    for path in files:
        session = Session(path)
        kept = [each for each in session.messages() if not each.repeated]
        assert set(kept) <= set(whole)
        first = next(m.log_time for m in kept if m.topic == CONTACTS and 1 in decode_contacts(m.data).contacts["phase"])
        assert kept[0].log_time <= max(first - 2 * STEP, whole[0].log_time), (
            "as much before the collision as was wanted"
        )
        assert replay(session).verdict is Verdict.IDENTICAL
    assert replay(Session(tmp_path / "run")).verdict is Verdict.IDENTICAL


def test_a_window_begins_with_a_snapshot_and_holds_no_more_than_it_must() -> None:
    snapshot = Snapshot({}, {})
    window = EventWindow(before=10e-9, after=0.0, limit=1 << 30, from_snapshots=True)
    decided: list[tuple[QueueEntry, bool]] = []
    for k in range(100):
        if k % 7 == 3:
            decided += window.take(QueueEntry("", b"", k, 0, k, snapshot=snapshot))
        decided += window.take(QueueEntry("/x", b"", k, 0, k, event=k == 60))
    kept = [entry for entry, is_kept in decided if is_kept]
    assert kept[0].snapshot is not None
    assert kept[0].log_time == 45, "52 is within the 10 that are wanted"
    assert [entry.log_time for entry in kept if entry.snapshot is None] == list(range(45, 61))
    dropped = [entry.log_time for entry, is_kept in decided if not is_kept and entry.snapshot is None]
    assert dropped == [*range(45), *range(61, 87)], "87 to 99 are held: 87 is the last snapshot before 89"


def rewritten(
    source: Path, target: Path, without: range = range(0), spoil: int | None = None, by: float = 0.25
) -> None:
    """Write the session without some messages, and with changed distances in message `spoil`."""
    session = Session(source)
    entries = list(session.entries())
    types = {each.topic: each.type for each in entries if isinstance(each, Recorded)}
    definitions = {name: definition(full_name(name)).encode() for name in types.values()}
    file = SessionFile(target, types, session.metadata, definitions)
    for each in entries:
        if isinstance(each, RecordedSnapshot):
            file.write_snapshot(each.data, each.sequence, each.log_time)
        elif each.sequence not in without:
            data = spoiled(each.data, by) if each.sequence == spoil else each.data
            file.write([QueueEntry(each.topic, data, each.log_time, each.publish_time, each.sequence)])
    file.finish()


def spoiled(data: bytes, by: float) -> bytes:
    contacts = decode_contacts(data)
    rows = contacts.contacts.copy()
    rows["signed_distance"] += by
    return encode_contacts(contacts.stamp_ns, contacts.frame_id, contacts.step, rows, contacts.ids, contacts.names)


def test_behind_a_gap_it_goes_on_with_the_next_snapshot(path: Path, tmp_path: Path) -> None:
    places = Session(path).timeline().snapshots
    gap = range(places[1].sequence + 3, places[1].sequence + 5)
    rewritten(path, tmp_path / "gap.mcap", without=gap)
    report = replay(Session(tmp_path / "gap.mcap"))
    assert (report.verdict, report.hole) == (Verdict.NOT_COMPARABLE, True), "what follows the gap was not compared"
    assert report.notes[0].startswith("2 messages are missing after step")
    assert report.notes[1].startswith("compared from the snapshot in step")
    assert report.steps == 50
    contacts = [m.sequence for m in Session(path).messages() if m.topic == CONTACTS]
    late = next(sequence for sequence in contacts if sequence > places[3].sequence)
    rewritten(path, tmp_path / "both.mcap", without=gap, spoil=late)
    assert replay(Session(tmp_path / "both.mcap")).verdict is Verdict.DIVERGED
    rewritten(path, tmp_path / "start.mcap", without=range(places[0].sequence))
    from_first = replay(Session(tmp_path / "start.mcap"))
    assert from_first.verdict is Verdict.IDENTICAL
    assert "with a snapshot in step" in from_first.notes[0]


def test_a_difference_is_cut_out_from_the_last_snapshot_on(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    places = Session(path).timeline().snapshots
    contacts = [m.sequence for m in Session(path).messages() if m.topic == CONTACTS]
    late = next(sequence for sequence in contacts if sequence > places[3].sequence + 10)
    rewritten(path, tmp_path / "bad.mcap", spoil=late)
    assert main(["replay", str(tmp_path / "bad.mcap"), "--cut", str(tmp_path / "cut.mcap")]) == Verdict.DIVERGED
    assert f"{late + 1 - places[3].sequence} messages that show" in capsys.readouterr().out
    whole, part = replay(Session(tmp_path / "bad.mcap")), replay(Session(tmp_path / "cut.mcap"))
    assert part.first_difference == whole.first_difference is not None
    assert part.messages == late + 1 - places[3].sequence
    first = next(Session(tmp_path / "cut.mcap").messages())
    assert first.repeated and first.type == "ObjectDescriptionArray", "for readers that do not use snapshots"


def test_what_is_within_the_tolerance_is_no_difference_to_cut_out(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = Session(path).timeline().snapshots[3].sequence
    contacts = [m.sequence for m in Session(path).messages() if m.topic == CONTACTS and m.sequence > place]
    rewritten(path, tmp_path / "near.mcap", spoil=contacts[0], by=1e-9)
    rewritten(tmp_path / "near.mcap", tmp_path / "bad.mcap", spoil=contacts[2])
    command = ["replay", str(tmp_path / "bad.mcap"), "--tolerance", "1e-6", "--cut", str(tmp_path / "cut.mcap")]
    assert main(command) == Verdict.DIVERGED
    assert f"{contacts[2] + 1 - place} messages that show" in capsys.readouterr().out


def test_a_damaged_snapshot_costs_only_itself(path: Path, tmp_path: Path) -> None:
    places = Session(path).timeline().snapshots
    data = bytearray(path.read_bytes())
    data[places[2].at + 300] ^= 1
    (tmp_path / "bad.mcap").write_bytes(data)
    report = replay(Session(tmp_path / "bad.mcap"))
    assert report.verdict is Verdict.IDENTICAL
    assert "the attachment of" in report.notes[0] and "its checksum is wrong" in report.notes[0]


def test_snapshots_of_another_version_are_not_believed(path: Path, tmp_path: Path) -> None:
    session = Session(path)
    entries = [
        each._replace(data=Snapshot({}, {}).encode()) if isinstance(each, RecordedSnapshot) else each
        for each in session.entries()
    ]
    session.entries = lambda begin=None: iter(entries)  # type: ignore[method-assign]
    assert replay(session).verdict is Verdict.IDENTICAL
    session.entries = lambda begin=None: iter(entries[60:])  # type: ignore[method-assign]
    late = replay(session)
    assert (late.verdict, late.late) == (Verdict.NOT_COMPARABLE, True)
    assert any("cannot be used: snapshot: expected the state of a monitor" in note for note in late.notes)
    session.entries = lambda begin=None: iter(entries[100:])  # type: ignore[method-assign]
    with pytest.raises(SessionError, match="replay it from the start, for the snapshot"):
        replay(session, start=0.3)


def test_salvage_keeps_them(path: Path, tmp_path: Path) -> None:
    data = path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) - 3000])
    salvage(tmp_path / "cut.mcap", tmp_path / "whole.mcap")
    found = Session(tmp_path / "whole.mcap").timeline().snapshots
    assert len(found) == 5
    assert replay(Session(tmp_path / "whole.mcap"), start=0.45).verdict is Verdict.IDENTICAL


KILLED = """
import sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from collision_monitor.session.recording import recorder, recording_files
from session_scene import record
recording_files.SNAPSHOT_PERIOD = recorder.SNAPSHOT_PERIOD = 0.1
recording_files.SNAPSHOT_SHARE = 1e9
run = record(Path(sys.argv[1]), snapshots=True, close=False)
while run.status()["recorded_messages"] < 150: pass
import os; os._exit(9)
"""


def test_a_recording_that_was_not_closed_has_its_snapshots(tmp_path: Path) -> None:
    helpers = Path(__file__).parents[2] / "helpers"
    child = subprocess.run([sys.executable, "-c", KILLED, tmp_path / "run.mcap", helpers], check=False)
    assert child.returncode == 9
    assert len(Session(tmp_path / "run.mcap").timeline().snapshots) == 5
    report = replay(Session(tmp_path / "run.mcap"), start=0.3)
    assert report.verdict is Verdict.IDENTICAL and report.begin > 0.2
