"""Tests of the live table and its one-line form, drawn from known messages."""

import numpy as np
from rich.console import Console

from collision_monitor import codec, records
from collision_monitor.cli.output.live_table import LatestAnswers
from collision_monitor.records import Phase, PredictionStatus

NAMES = ["robot_1", "rack_7", "person_3"]


def picture(**status):
    contacts = np.zeros(3, records.CONTACT)
    contacts["id_a"], contacts["id_b"] = (1, 1, 7), (7, 7, 9)
    contacts["signed_distance"], contacts["duration"] = (-0.025, -0.02, 0.5), 1.5
    contacts["point_index"] = (0, 1, 0)
    contacts["phase"] = (Phase.PERSIST, Phase.PERSIST, Phase.END)
    impacts = np.zeros(2, records.PREDICTION)
    impacts["id_a"], impacts["id_b"] = (7, 1), (9, 9)
    impacts["lower"], impacts["upper"] = (0.25, 0.75), (np.inf, 0.76)
    impacts["status"] = (PredictionStatus.UNRESOLVED, PredictionStatus.HIT)
    ids = np.array([1, 7, 9], np.uint32)
    return LatestAnswers(
        title="test",
        elapsed=3.0,
        contacts=codec.ContactArray(0, "world", 1, contacts, ids, NAMES),
        predictions=codec.PredictedCollisionArray(0, "world", 1, 2.0, impacts, ids, NAMES),
        status=codec.MonitorStatus(objects=3, contacts=1, predictions=2, latency=0.0042, rate=50.0, **status),
    )


def drawn(picture):
    console = Console(width=110, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(picture.table())
    return console.export_text()


def test_the_table_shows_each_pair_once_soonest_first():
    text = drawn(picture(recording=1, recorded_messages=17))
    lines = [line for line in text.splitlines() if "–" in line and "│" in line]
    assert len(lines) == 3
    touching, possible, certain = lines
    assert "robot_1 – rack_7" in touching
    assert "25.0 mm" in touching
    assert "1.50 s" in touching
    assert "rack_7 – person_3" in possible
    assert "0.25 s" in possible
    assert "not known" in possible
    assert "unresolved" in possible
    assert "robot_1 – person_3" in certain
    assert "0.76 s" in certain
    assert "50 Hz" in text
    assert "latency 4.2 ms" in text
    assert "recording, 17 messages" in text


def test_the_table_fits_80_columns_and_cuts_nothing_but_long_names():
    console = Console(width=80, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(picture(recording=1).table())
    text = console.export_text()
    assert max(map(len, text.splitlines())) <= 80
    for whole in ("robot_1 – rack_7", "rack_7 – person_3", "at the latest", "unresolved", "not known", "closing at"):
        assert whole in text


def test_what_is_stale_or_not_recorded_is_said():
    text = drawn(picture(objects_stale=2, recording=2))
    assert "2 STALE" in text
    assert "RECORDING FAILED" in text


def test_the_line_names_the_soonest_pair():
    assert "1 touching, 2 predicted, next: rack_7 – person_3 in 0.25 s (unresolved)" in picture().line()


def test_before_the_first_message():
    empty = LatestAnswers("test", 0.0, None, None, codec.MonitorStatus())
    assert "0 touching, 0 predicted" in empty.line()
    assert "not recording" in drawn(empty)
