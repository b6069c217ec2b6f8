"""The time line of a session on the panel: a slider, buttons to play and to step, and the contacts that begin."""

from __future__ import annotations

from functools import partial
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Final

from collision_monitor.settings.names import shortened
from collision_monitor.view.panel import Request
from collision_monitor.view.player import Player
from collision_monitor.view.recording import Beginning, RecordedSteps

if TYPE_CHECKING:
    import viser

SPEEDS: Final = ("0.1 ×", "0.25 ×", "0.5 ×", "1 ×", "2 ×", "5 ×", "10 ×")
LISTED: Final = 200
"""Contacts in the list to jump to."""

MARKS: Final = 16
"""Contacts that the slider marks. More marks would hide it."""

LONGEST_NAME: Final = 20

_CHOOSE: Final = "–"


class PlayerControls:
    """The controls of a player."""

    def __init__(
        self, server: viser.ViserServer, recording: RecordedSteps, player: Player, requests: SimpleQueue[Request]
    ) -> None:
        self._recording, self._player, self._requests = recording, player, requests
        self._shown = 0.0
        gui = server.gui
        end = max(player.end, 1e-3)
        marks = tuple(dict.fromkeys(recording.times[each.frame] for each in recording.begins[:LISTED]))
        self._slider: Any = gui.add_slider(
            "time (s)", 0.0, end, min(0.01, end), 0.0, marks=tuple(map(float, marks)) if len(marks) <= MARKS else None
        )
        self._slider.on_update(lambda event: self._ask(event, partial(self._scrub, event.target.value)))
        self._play = gui.add_button("play", icon=None)
        self._play.on_click(lambda _: requests.put(player.toggle))
        self._steps = gui.add_button_group("step", ("|‹", "‹ contact", "‹", "›", "contact ›", "›|"))
        self._steps.on_click(lambda event: self._ask(event, partial(self._step, event.target.value)))
        self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1 ×")
        self._speed.on_update(lambda event: self._ask(event, self._change_speed))
        self._places = {self._text(each): each for each in recording.begins[:LISTED]}
        self._contacts: Any = gui.add_dropdown("contacts", (_CHOOSE, *self._places), visible=bool(self._places))
        self._contacts.on_update(lambda event: self._ask(event, self._go_to_contact))

    def _text(self, begin: Beginning) -> str:
        names = self._recording.names
        pair = " – ".join(
            shortened(names.get(object_id, f"object_{object_id}"), LONGEST_NAME) for object_id in begin.pair
        )
        return f"{self._recording.times[begin.frame]:.2f} s  {pair}"

    def show(self) -> None:
        """Show where the player is."""
        if self._player.time != self._shown:  # else a browser that drags the slider would be disturbed
            self._shown = self._player.time
            self._slider.value = self._shown
        self._play.label = "pause" if self._player.playing else "play"

    def _ask(self, event: Any, request: Request) -> None:
        """Queue what a browser asked for; changes by the program itself have no browser."""
        if event.client is not None:
            self._requests.put(request)

    def _scrub(self, time: float) -> None:
        self._player.playing = False
        self._player.seek(time)

    def _change_speed(self) -> None:
        if self._speed.value in SPEEDS:
            self._player.speed = float(self._speed.value.split()[0])

    def _go_to_contact(self) -> None:
        chosen = self._places.get(self._contacts.value)
        if chosen is not None:
            self._go_to(chosen.frame)
            self._contacts.value = _CHOOSE

    def _step(self, step: str) -> None:
        frame = self._recording.frame_at(self._player.time)
        contacts = [each.frame for each in self._recording.begins]
        targets = {
            "|‹": 0,
            "‹ contact": max((at for at in contacts if at < frame), default=0),
            "‹": max(frame - 1, 0),
            "›": min(frame + 1, len(self._recording) - 1),
            "contact ›": min((at for at in contacts if at > frame), default=len(self._recording) - 1),
            "›|": len(self._recording) - 1,
        }
        self._go_to(targets[step])

    def _go_to(self, frame: int) -> None:
        self._scrub(self._recording.times[frame])
