"""1,000 hostile messages to a node in its own process, over DDS, and a known scene between them."""

from __future__ import annotations

from pathlib import Path

from dds_campaign import BATCH, attack_node

MESSAGES = 1000


def test_no_message_over_dds_kills_a_node_or_changes_its_answers_to_a_known_scene(
    ros_domain_id: int, tmp_path: Path
) -> None:
    report = attack_node(11, MESSAGES, rate=1000.0, folder=tmp_path)
    assert report["problems"] == [], (tmp_path / "node.log").read_text()[-2000:]
    assert report["messages"] == MESSAGES
    assert report["known answers"] == MESSAGES // BATCH
