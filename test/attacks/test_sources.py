"""4,000 hostile messages of other programs in this process, and the command that sends more."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from source_campaign import SourceCampaign, attacked_decoder
from source_messages import MAKERS, hostile_source_message

from collision_monitor.errors import MessageError
from collision_monitor.sources.messages.poses import PoseSource

START = 1_700_000_000_000_000_000
SEEDS = range(1, 3)
MESSAGES = 2_000


@pytest.mark.parametrize("seed", SEEDS)
def test_no_message_breaks_a_source_or_loses_a_known_object(seed: int) -> None:
    summary = SourceCampaign(seed).run(MESSAGES)
    assert [f"{each.index}: {each.problem}" for each in summary.failures] == []
    assert summary.messages == MESSAGES and summary.known > 0.2 * MESSAGES
    assert set(summary.by_topic) == set(MAKERS) and min(summary.by_topic.values()) > 40
    assert summary.states > MESSAGES and summary.descriptions > 0.3 * MESSAGES and summary.refused > 0.3 * MESSAGES


def test_the_same_seed_gives_the_same_messages() -> None:
    first, second = ([hostile_source_message(3, index, START) for index in range(200)] for _ in range(2))
    assert first == second != [hostile_source_message(4, index, START) for index in range(200)]


def test_most_messages_can_be_read_so_that_hostile_ones_meet_sources_at_work() -> None:
    read = 0
    for index in range(1000):
        message = hostile_source_message(1, index, START)
        try:
            attacked_decoder()(message.type, message.data)
            read += 1
        except MessageError:
            pass
    assert 700 < read < 1000


def test_a_source_that_raises_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: object) -> None:
        raise KeyError("what nobody expects")

    monkeypatch.setattr(PoseSource, "take", failing)
    (failure,) = SourceCampaign(1).run(200).failures
    assert "KeyError: 'what nobody expects'" in failure.problem


def test_the_command_attacks_the_sources(tmp_path: Path) -> None:
    command = [sys.executable, str(Path(__file__).with_name("fuzz_messages.py")), "--sources", "--messages", "300"]
    done = subprocess.run([*command, "--json", "--folder", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["messages"] == 300 and not result["failures"] and set(result["by topic"]) == set(MAKERS)
