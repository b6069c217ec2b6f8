"""How the bodies of a simulated scene respond when they meet: the methods behind `--response`."""

from __future__ import annotations

from typing import Protocol

from collision_monitor.world.rigid.impulse_response import PARTS, ImpulseResponse
from collision_monitor.world.rigid.penalty_response import PenaltyResponse
from collision_monitor.world.rigid.response_choice import ResponseOptions
from collision_monitor.world.rigid.rigid_bodies import RigidBodies
from collision_monitor.world.rigid.stick_response import StickResponse


class Response(Protocol):
    """Advances bodies by a time."""

    def advance(self, world: RigidBodies, dt: float) -> None:
        """Advance the bodies by `dt` seconds."""


def make_response(options: ResponseOptions, speed: float, parts: int = PARTS) -> Response:
    """The response of the options; speed (m/s): the fastest that the scene expects, for which springs are made.

    parts: of a substep, into which impulses divide it where bodies meet.
    """
    match options.response:
        case "penalty":
            return PenaltyResponse(1.0, options.gravity, speed)
        case "damped":
            return PenaltyResponse(options.restitution, options.gravity, speed)
        case "stick":
            return StickResponse(options.gravity)
    return ImpulseResponse(options.restitution, options.gravity, parts)
