"""The benchmark through DDS: its counts agree with each other, and it reports when it cannot measure."""

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "through_node.py"


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, SCRIPT, *arguments], capture_output=True, text=True, timeout=240)


def test_a_short_run_accounts_for_every_state():
    answer = run("--objects", "20", "--rate", "40", "--duration", "2", "--json")
    assert answer.returncode == 0, answer.stderr
    (m,) = json.loads(answer.stdout)["measurements"]
    assert m["published"] + m["periods_skipped"] == 80
    assert 0 < m["answered"] <= m["published"]
    assert m["states_lost"] + m["answers_lost"] <= m["dropped"] == m["published"] - m["answered"]
    assert 0 < m["latency_median"] <= m["latency_p99"] <= m["latency_max"]
    assert m["recorded"] > 3 * m["answered"]  # states, contacts, predictions, and some statuses
    assert m["recording_dropped"] == 0
    assert m["node_cpu_percent"] > 0 and m["memory_start"] > 50


def test_what_cannot_be_measured_is_an_error_in_one_line():
    answer = run("--scene", "nowhere")
    assert answer.returncode == 1
    assert answer.stderr.startswith("through_node: error: scene: expected one of fleet")
    assert len(answer.stderr.splitlines()) == 1


def test_a_process_that_fails_is_quoted():
    answer = run("--scene", "fleet", "--objects", "1", "--rate", "10", "--duration", "1")
    assert answer.returncode == 1
    assert "takes a whole number from 2" in answer.stderr
    assert "Traceback" not in answer.stderr
