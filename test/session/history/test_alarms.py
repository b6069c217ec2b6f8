"""Tests of the definition of alarms, against a plain loop over pairs and steps, and on the commands that share it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from played_session import record_scene

from collision_monitor import records
from collision_monitor.cli.main import main
from collision_monitor.records import Phase, PredictionStatus
from collision_monitor.session.history.alarms import Alarms, CertainContacts

STEPS, PERIOD, HORIZON = 12, 0.1, 0.45


def rows(kind: np.dtype, pairs: list[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the pairs (0, k), given as (k, step)."""
    found = np.zeros(len(pairs), kind)
    found["id_b"] = [k for k, _ in pairs]
    return found, np.array([step for _, step in pairs], np.int64)


def plainly(touching: set, stated: dict[tuple[int, int], tuple[float, float]]) -> Alarms:
    """The definition, word by word."""
    end = (STEPS - 1) * PERIOD
    alarms = false = still_open = late = early = 0
    for k, step in sorted(touching | stated.keys()):
        for is_contact in (True, False):
            if (k, step) not in (touching if is_contact else stated):
                continue
            alarms += 1
            low, high = (0.0, HORIZON) if is_contact else stated[k, step]
            later = [s for s in range(step, STEPS) if (k, s) in touching]
            wait = (later[0] - step) * PERIOD if later else np.inf
            if wait <= HORIZON + PERIOD + 1e-9:
                if not is_contact:
                    late += low > wait
                    early += high < wait - PERIOD - 1e-9
            elif step * PERIOD + min(high, HORIZON) > end + 1e-9:
                still_open += 1
            else:
                false += 1
    begins = [(k, s) for k, s in touching if s > 0 and (k, s - 1) not in touching]
    missed = sum((k, s - 1) not in stated for k, s in begins)
    return Alarms(alarms, false, still_open, late, early, len(begins), missed)


PAIR_STEPS = st.tuples(st.integers(1, 3), st.integers(0, STEPS - 1))


@given(
    st.sets(PAIR_STEPS, max_size=12),
    st.dictionaries(PAIR_STEPS, st.tuples(st.sampled_from([0.03, 0.17, 0.31]), st.sampled_from([0.04, 0.22, np.inf]))),
)
def test_counts_are_those_of_the_definition(touching, stated) -> None:
    contacts, contact_steps = rows(records.CONTACT, sorted(touching))
    predictions, prediction_steps = rows(records.PREDICTION, sorted(stated))
    for name, column in (("lower", 0), ("upper", 1)):
        predictions[name] = [stated[each][column] for each in sorted(stated)]
    judge = CertainContacts.of(np.arange(STEPS) * PERIOD, contacts, contact_steps, HORIZON)
    found = judge.judge(contacts, contact_steps, predictions, prediction_steps)
    assert found == plainly(touching, stated)


def test_flicker_changes_the_number_of_alarms_and_not_of_their_kind() -> None:
    """A prediction in every second step is half as many false alarms, not more of them."""
    judge = CertainContacts.of(np.arange(STEPS) * PERIOD, *rows(records.CONTACT, []), HORIZON)
    lasting, flickering = (
        judge.judge(*rows(records.CONTACT, []), *rows(records.PREDICTION, [(1, s) for s in range(0, 6, k)]))
        for k in (1, 2)
    )
    assert (lasting.false_alarms, flickering.false_alarms) == (6, 3)


def test_gaps_ends_and_possible_predictions() -> None:
    times = np.array([0.0, 0.1, 0.2, 5.0, 5.1])
    ended, at = rows(records.CONTACT, [(1, 3)])
    ended["phase"] = Phase.END
    judge = CertainContacts.of(times, ended, at, HORIZON, longest_step=1.0)
    predictions, steps = rows(records.PREDICTION, [(1, 2), (1, 3)])
    predictions["upper"] = np.inf
    assert judge.judge(ended, at, predictions, steps) == Alarms(alarms=2, open_alarms=2)
    predictions["status"] = PredictionStatus.POSSIBLE
    assert judge.judge(ended, at, predictions, steps) == Alarms()


def test_tradeoff_and_compare_count_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = str(record_scene(tmp_path / "clutter.mcap", "clutter", 3.0, objects=30))
    coarse = tmp_path / "coarse.yaml"
    coarse.write_text("based_on: fast\nadaptive_tolerances: false\n")
    profiles = ["--profile", str(coarse), "--profile", "exact"]
    main(["compare", session, *profiles, "--json"])
    compared = json.loads(capsys.readouterr().out)
    main(["tradeoff", session, *profiles, "--json"])
    measured = json.loads(capsys.readouterr().out)["rows"]
    for side, row in zip((compared["a"], compared["b"]), measured, strict=True):
        for name in ("alarms", "false_alarms", "open_alarms", "late", "early"):
            assert side["alarms"][name] == row[name], name
    assert measured[0]["false_alarms"] > measured[1]["false_alarms"]
