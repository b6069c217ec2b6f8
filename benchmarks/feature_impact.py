"""Measure impact queries of a vertex and a face, and of two edges: easy queries, hits, and the hardest known.

Prints a Markdown table with the mean over a batch (µs), the longest single query (each the fastest of 5 calls, with
some 5 µs of Python), and the part of hits and unresolved queries.

    python benchmarks/feature_impact.py
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import collision_monitor as cm

Array = NDArray[np.float64]
COUNT, SINGLE, RUNS = 20_000, 300, 5


def passing(rng: np.random.Generator, kind: str) -> Array:
    """Queries as a broad phase returns them: features of size 1, 1 to 3 apart, that move by a tenth."""
    x = rng.normal(size=(COUNT, 4, 3))
    x[:, : 1 if kind == "face" else 2] += rng.normal(size=(COUNT, 1, 3)) * 2
    return np.concatenate([x, x + 0.1 * rng.normal(size=x.shape)], axis=1)


def anywhere(rng: np.random.Generator, kind: str) -> Array:
    """All eight points at random around the origin."""
    return rng.normal(size=(COUNT, 8, 3))


def hits(rng: np.random.Generator, kind: str) -> Array:
    """The random queries that meet."""
    x = anywhere(rng, kind)
    return np.asarray(x[solver(kind)(x).status != "clear"])


def coplanar(rng: np.random.Generator, kind: str) -> Array:
    """All points in one plane, turned at random: the features slide in it and touch for an interval."""
    x = rng.normal(size=(COUNT // 20, 8, 3)) * [1, 1, 0]
    turn = np.linalg.qr(rng.normal(size=(len(x), 3, 3)))[0]
    return np.asarray(x @ turn.transpose(0, 2, 1))


def collinear(rng: np.random.Generator, kind: str) -> Array:
    """All points on one line."""
    return rng.normal(size=(COUNT // 20, 8, 1)) * rng.normal(size=(COUNT // 20, 1, 3))


def grazing(rng: np.random.Generator, kind: str) -> Array:
    """Coplanar queries that leave the plane by 1e-7: within the tolerance all the time."""
    x = coplanar(rng, kind)
    return x + 1e-7 * rng.normal(size=x.shape)


def resting(rng: np.random.Generator, kind: str) -> Array:
    """Features that touch at the start and hardly move."""
    x = np.array(hits(rng, kind)[: COUNT // 20])
    answer = solver(kind)(x)
    t = answer.lower[:, None, None]
    at = (1 - t) * x[:, :4] + t * x[:, 4:]
    return np.concatenate([at, at + 1e-9 * rng.normal(size=at.shape)], axis=1)


def solver(kind: str) -> Callable[..., Any]:
    """Query function for the kind of features."""
    return cm.vertex_face_impact if kind == "face" else cm.edge_edge_impact


def longest(solve: Callable[..., Any], x: Array, separation: float) -> float:
    """Longest of some single queries (µs), including the unresolved ones, which use up their budget."""
    worst = 0.0
    hardest = np.argsort(solve(x, separation).status != "unresolved", kind="stable")
    for query in x[hardest[:SINGLE]]:
        best = np.inf
        for _ in range(RUNS):
            start = time.perf_counter()
            solve(query, separation)
            best = min(best, time.perf_counter() - start)
        worst = max(worst, best)
    return 1e6 * worst


def main() -> None:
    """Measure and print the table."""
    print("| queries | kind | separation (m) | mean (µs) | longest (µs) | hits | unresolved |")
    print("|---|---|---:|---:|---:|---:|---:|")
    for make in (passing, anywhere, hits, coplanar, grazing, collinear, resting):
        for kind in ("face", "edges"):
            x = make(np.random.default_rng(1), kind)
            for separation in (0.0, 1e-3):
                solve = solver(kind)
                best = np.inf
                for _ in range(RUNS):
                    start = time.process_time()
                    answer = solve(x, separation)
                    best = min(best, time.process_time() - start)
                part = [f"{100 * float((answer.status == name).mean()):.3g} %" for name in ("hit", "unresolved")]
                print(
                    f"| {make.__name__} | {kind} | {separation:g} | {1e6 * best / len(x):.2f} | "
                    f"{longest(solve, x, separation):.0f} | {part[0]} | {part[1]} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
