"""Tests of the player."""

from __future__ import annotations

from collision_monitor.view.player import Player


def test_it_plays_at_its_speed_and_stops_at_the_end() -> None:
    player = Player(end=2.0, speed=5.0)
    player.advance(1.0)
    assert player.time == 0.0
    player.toggle()
    player.advance(0.1)
    assert player.playing and player.time == 0.5
    player.advance(1.0)
    assert not player.playing and player.time == 2.0
    player.toggle()
    assert player.playing and player.time == 0.0


def test_it_stays_within_the_recording() -> None:
    player = Player(end=2.0)
    player.seek(-1.0)
    assert player.time == 0.0
    player.seek(9.0)
    assert player.time == 2.0
