"""`tradeoff --impact-methods`: every method on the pairs of a scene, with what each misses."""

from __future__ import annotations

import json

import pytest

from collision_monitor.accuracy.tradeoff.impact_tradeoff import METHODS
from collision_monitor.cli.main import main

ARGUMENTS = ["tradeoff", "--scene", "crossing", "--seconds", "1", "--impact-methods"]


def test_the_certified_method_misses_nothing_and_the_others_say_what_they_refuse(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main([*ARGUMENTS, "--json"]) == 0
    rows = {row["method"]: row for row in json.loads(capsys.readouterr().out)["rows"]}
    assert list(rows) == list(METHODS)
    exact = rows["conservative_advancement"]
    assert exact["hits"] > 0
    assert exact["missed"] == 0
    assert exact["early_s"] < 1e-4
    assert rows["swept_bounds"]["hits"] == 0
    assert rows["end_of_step"]["late_s"] <= 1 / 60 + 1e-9
    assert rows["closed_form"]["pairs"] <= exact["pairs"]


def test_a_table_for_people_and_options_that_do_not_go_together(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(ARGUMENTS) == 0
    assert "bisection" in capsys.readouterr().out
    assert main([*ARGUMENTS, "--model", "obb"]) == 2
    assert "--impact-methods" in capsys.readouterr().err
