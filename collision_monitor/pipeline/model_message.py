"""Models as bytes, for the pipe to the process that makes them: every number comes back to the bit, and no code runs.

The format is NumPy's own, without objects. A piece is its class name and its fields. A pose is set as it is: its
constructor would normalise the quaternion again and could change the last bit, so that a replay would differ.
"""

from __future__ import annotations

from dataclasses import fields
from io import BytesIO
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np

from collision_monitor.objects.models import Modelled
from collision_monitor.records import Model
from collision_monitor.shapes.kinds.convex_hull import TRIANGLE
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import KINDS

_REASON: Final = "reason"
_CLASSES: Final = {kind.shape.__name__: kind.shape for kind in (*KINDS, TRIANGLE)}


def encode_model(model: Modelled | str) -> bytes:
    """Encode a model, or the text that says why there is none."""
    buffer = BytesIO()
    if isinstance(model, str):
        np.savez(buffer, allow_pickle=False, **{_REASON: np.array(model)})
        return buffer.getvalue()
    arrays: dict[str, Any] = {
        "kinds": np.array([type(piece).__name__ for piece, _ in model.pieces], np.str_),
        "positions": np.array([pose.position for _, pose in model.pieces]),
        "quaternions": np.array([pose.quaternion for _, pose in model.pieces]),
        "shapes": np.array(model.shapes, np.int64),
        "model": np.int64(model.model),
        "excess": np.float64(model.excess),
        "convex": np.bool_(model.convex),
        "corners": np.array([corners is not None for corners in model.corners], np.bool_),
    }
    for k, (piece, _) in enumerate(model.pieces):
        arrays |= {f"{k}.{field.name}": np.asarray(getattr(piece, field.name)) for field in fields(piece)}
    arrays |= {f"{k}/corners": corners for k, corners in enumerate(model.corners) if corners is not None}
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def decode_model(data: bytes) -> Modelled | str:
    """Decode what `encode_model` wrote. Raises ValueError for other bytes."""
    try:
        with np.load(BytesIO(data), allow_pickle=False) as file:
            return _decoded(dict(file))
    except (EOFError, KeyError, BadZipFile) as error:
        raise ValueError(f"expected a model, got {len(data)} bytes: {error}") from None


def _decoded(arrays: dict[str, Any]) -> Modelled | str:
    if _REASON in arrays:
        return str(arrays[_REASON])
    values: list[dict[str, Any]] = [{} for _ in arrays["kinds"]]
    for key, value in arrays.items():
        k, dot, name = key.partition(".")
        if dot:
            values[int(k)][name] = value
    pieces = [_CLASSES[kind](**own) for kind, own in zip(arrays["kinds"].tolist(), values, strict=True)]
    numbers = zip(arrays["positions"].tolist(), arrays["quaternions"].tolist(), strict=True)
    poses = [Pose.of_numbers((*position, *quaternion)) for position, quaternion in numbers]
    return Modelled(
        pieces=list(zip(pieces, poses, strict=True)),
        shapes=arrays["shapes"].tolist(),
        model=Model(int(arrays["model"])),
        excess=float(arrays["excess"]),
        convex=bool(arrays["convex"]),
        corners=tuple(arrays[f"{k}/corners"] if known else None for k, known in enumerate(arrays["corners"])),
    )
