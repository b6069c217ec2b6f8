"""Reader of recorded tracks in CSV, one row for each object and frame. Its errors name the file and the line."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from io import TextIOWrapper
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.settings.regular_file import open_regular

LARGEST_TRACKS = 64 << 20
"""Bytes of a file: about a million rows, which take ten times that memory."""

_LARGEST = 2**31 - 1


@dataclass(frozen=True, eq=False)
class TrackFile:
    """Rows of one file in their order: ids and frames (n,), and the values of the requested columns (n, k).

    Frames increase within each id.
    """

    path: Path
    id: NDArray[np.int64]
    frame: NDArray[np.int64]
    values: NDArray[np.float64]


def read_track_file(path: Path, columns: tuple[str, ...]) -> TrackFile:
    """Read the columns `id`, `frame` and `columns` of a CSV file. Raises InputError if the file is not valid."""
    try:
        with (
            open_regular(path, "a CSV file", most=LARGEST_TRACKS) as file,
            TextIOWrapper(file, "utf-8-sig", newline="") as text,
        ):
            return _parse(path, csv.reader(text), columns)
    except OSError as error:
        raise InputError(f"{path}: expected a CSV file, got {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: expected a CSV text file in UTF-8, got other bytes") from None
    except csv.Error as error:
        raise InputError(f"{path}: expected a CSV text file, got something else: {error}") from None


def _parse(path: Path, lines: Iterator[list[str]], columns: tuple[str, ...]) -> TrackFile:
    header = [cell.strip() for cell in next(lines, [])]
    wanted = ("id", "frame", *columns)
    if not header:
        raise InputError(f"{path}: expected a header with the columns {', '.join(wanted)}, got an empty file")
    if missing := [name for name in wanted if name not in header]:
        raise InputError(f"{path}: the columns {', '.join(missing)} are missing; there are {', '.join(header)}")
    places = [header.index(name) for name in wanted]

    ids, frames, values = [], [], []
    last_frame: dict[int, int] = {}
    for line, cells in enumerate(lines, start=2):
        if not any(cell.strip() for cell in cells):
            continue
        where = f"{path}, line {line}"
        if len(cells) != len(header):
            raise InputError(f"{where}: expected {len(header)} cells as in the header, got {len(cells)}")
        object_id, frame = (_whole_number(cells[p], f"{where}, column {header[p]}") for p in places[:2])
        if frame <= last_frame.get(object_id, -1):
            raise InputError(
                f"{where}: expected the frames of id {object_id} to rise, got {frame} after {last_frame[object_id]}"
            )
        last_frame[object_id] = frame
        ids.append(object_id)
        frames.append(frame)
        values.append([_number(cells[p], f"{where}, column {header[p]}") for p in places[2:]])
    if not ids:
        raise InputError(f"{path}: expected rows below the header, got none")
    return TrackFile(path, np.array(ids), np.array(frames), np.array(values))


def _number(cell: str, where: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        raise InputError(f"{where}: expected a number, got {cell!r}") from None
    if not isfinite(number):
        raise InputError(f"{where}: expected a finite number, got {cell!r}")
    return number


def _whole_number(cell: str, where: str) -> int:
    number = _number(cell, where)
    if not (number.is_integer() and 0 <= number <= _LARGEST):
        raise InputError(f"{where}: expected a whole number from 0 to {_LARGEST}, got {cell!r}")
    return int(number)
