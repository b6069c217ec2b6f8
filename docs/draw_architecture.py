"""Draws the pictures of docs/architecture.md: the floors with the imports of each folder, and the stages of a step.

python docs/draw_architecture.py
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from collision_monitor._jit.imports import direct_imports, source_file

IMAGES = Path(__file__).parent / "images"
PACKAGE = Path(__file__).parents[1] / "collision_monitor"
WIDTH = 900  # px; lengths below are in px as well, from the upper left corner
DPI = 96

INK, QUIET = "#1a1a1a", "#555555"
PLAIN, ROS, STAGE, DATA, BRANCH = "#eef3f8", "#fdeee0", "#eaf4ec", "#ffffff", "#f4edf7"

mpl.rcParams.update({"svg.hashsalt": "collision_monitor", "font.family": "DejaVu Sans", "font.size": 8})

GROUND = ("_jit", "errors", "tolerances", "records", "_version")
FLOORS: tuple[tuple[tuple[str, str], ...], ...] = (
    (("cli", "the command line, one file per command"),),
    (
        ("ros", "the node, the guard, the world that plays scenes"),
        ("report", "the HTML page of a session"),
        ("view", "a page in the browser, live or of a session"),
        ("accuracy", "tradeoff, tune, extremes, timing"),
    ),
    (("sources", "messages of other programs, live or in bags"), ("session", "record, read, replay, compare, check")),
    (("pipeline", "message bytes in, monitor, message bytes out"), ("warm_up", "compile all kernels ahead")),
    (("alerts", "rules about pairs, evaluated after each step"),),
    (
        ("monitor", "the stages of a step"),
        ("query", "two shapes without a monitor"),
        ("detection", "all contacts of one frame"),
        ("codec", "message bytes, arrays"),
        ("world", "scenes to play"),
    ),
    (
        ("objects", "description of an object, its models"),
        ("uncertainty", "how likely two bodies meet"),
        ("robots", "URDF, SRDF, forward kinematics"),
    ),
    (("impact", "when two bodies first meet, and their contact now"),),
    (
        ("meshes", "trees over triangles and points: distance, overlap, advance"),
        ("motion", "how bodies move, as the kernels read them"),
    ),
    (
        ("broad_phase", "grids, trees, sweep and prune"),
        ("narrow_phase", "one file per pair test, dispatch"),
        ("response", "what simulated bodies do when they meet"),
    ),
    (("geometry.lecture", "methods of the lectures that nothing hot imports"),),
    (("shapes", "what a shape is: one file a kind, their table, poses"),),
    (
        ("geometry", "points, polygons, polyhedra, bounds"),
        ("settings", "settings and profiles"),
    ),
    (("checks", "numbers that a user or a file gives"),),
)


def folder(module: str) -> str:
    """The box of a module: its folder below the package, or the inner room that stands on a floor of its own."""
    top, _, inner = module.partition(".")[2].partition(".")
    room = f"{top}.{inner.partition('.')[0]}"
    return room if any(room == name for floor in FLOORS for name, _ in floor) else top


def folder_imports() -> dict[str, list[str]]:
    """The folders of the package that each folder imports directly, without itself and the ground floor."""
    found: dict[str, set[str]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        module = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
        if "." not in module:
            continue
        own = folder(module)
        others = {folder(other) for other in direct_imports(module) if source_file(other) and "." in other}
        found.setdefault(own, set()).update(others - {own, *GROUND})
    order = [name for floor in FLOORS for name, _ in floor]
    return {name: sorted(others, key=order.index) for name, others in found.items() if name in order}


def sheet(height: int) -> tuple[Figure, Axes]:
    """A white page of WIDTH x height px, with y downwards."""
    figure = plt.figure(figsize=(WIDTH / DPI, height / DPI), dpi=DPI, facecolor="white")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, WIDTH)
    axes.set_ylim(height, 0)
    axes.axis("off")
    return figure, axes


def box(axes: Axes, x: float, y: float, width: float, height: float, color: str) -> None:
    """A box with its upper left corner at (x, y)."""
    style = "round,pad=0,rounding_size=5"
    axes.add_patch(FancyBboxPatch((x, y), width, height, boxstyle=style, fc=color, ec=INK, lw=0.9))


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], bend: str = "arc3") -> None:
    """An arrow from start to end."""
    style = {"arrowstyle": "-|>,head_width=0.22,head_length=0.45", "color": INK, "lw": 1.1, "connectionstyle": bend}
    axes.annotate("", xy=end, xytext=start, arrowprops={**style, "shrinkA": 0, "shrinkB": 0})


def draw_floors() -> None:
    """Draw images/architecture.svg."""
    imports = folder_imports()
    gap, space, left, right = 18, 10, 14, WIDTH - 14
    texts = {}  # lines of the purpose and of the imports
    for floor in FLOORS:
        width = (right - left - space * (len(floor) - 1)) / len(floor)
        letters = int((width - 18) / 5.8)
        for name, purpose in floor:
            below = ", ".join(imports[name]) or "the ground floor only"
            texts[name] = textwrap.wrap(purpose, letters), textwrap.wrap(f"imports {below}", letters)
    heights = [45 + 11 * max(sum(map(len, texts[name])) for name, _ in floor) for floor in FLOORS]  # px
    figure, axes = sheet(sum(heights) + gap * len(FLOORS) + 98)
    y = 14.0
    for floor, tall in zip(FLOORS, heights, strict=True):
        width = (right - left - space * (len(floor) - 1)) / len(floor)
        for k, (name, _) in enumerate(floor):
            x = left + k * (width + space)
            box(axes, x, y, width, tall, ROS if name in ("ros", "cli") else PLAIN)
            axes.text(x + 9, y + 16, name.replace(".", "/"), weight="bold", size=10.5, va="center", color=INK)
            purpose, below = ("\n".join(lines) for lines in texts[name])
            axes.text(x + 9, y + 28, purpose, va="top", color=INK, linespacing=1.15)
            axes.text(x + 9, y + tall - 6, below, va="bottom", color=QUIET, size=7.4, linespacing=1.15)
        y += tall
        arrow(axes, (WIDTH / 2, y + 1), (WIDTH / 2, y + gap - 1))
        y += gap
    box(axes, left, y, right - left, 34, "#e4e4e4")
    axes.text(left + 9, y + 17, "   ".join(GROUND), weight="bold", size=10.5, va="center")
    axes.text(right - 9, y + 17, "ground floor: imported by all", va="center", ha="right", color=INK)
    note = (
        "Each folder imports itself and folders on floors below. One import goes sideways: from sources to session.\n"
        "Only the orange folders import ROS 2."
    )
    axes.text(left, y + 44, note, va="top", color=INK, linespacing=1.3)
    figure.savefig(IMAGES / "architecture.svg", metadata={"Date": None})
    plt.close(figure)


STAGES: tuple[tuple[str, str, str, str], ...] = (
    (
        "1  intake",
        "intake.py",
        "arguments to records.STATE; advance the time (state/timeline.py), refuse a\n"
        "jump until a second message confirms it; store the states in the roster",
        "bodies with new states",
    ),
    (
        "2  tracking",
        "tracking.py",
        "find bodies that left their predicted motion or are not predicted far enough;\n"
        "start their motion anew or continue it, and put their swept boxes into the grid",
        "body slots: moved, ending",
    ),
    (
        "3  candidates",
        "candidates.py",
        "find the pairs with swept boxes that meet; drop pairs that are never checked",
        "pairs (P, 2) of slots",
    ),
    (
        "4  first impacts",
        "first_impacts.py",
        "compute the first impact of each pair, on all threads",
        "events (IMPACT)",
    ),
    (
        "5  event list",
        "event_list.py",
        "keep the pending events in order of time; take the due ones;\n"
        "drop events of outdated motions when new ones are merged in",
        "due events",
    ),
    (
        "6  active pairs",
        "active_pairs.py",
        "unite the due pairs with those of the last step; compute their contacts;\n"
        "predict again the pairs that do not touch",
        "active pairs with their contacts, pending events",
    ),
    (
        "7  answers",
        "answers.py",
        "write contacts and predictions, apply the filters, add to the digest",
        "StepResult: contacts, predictions, status",
    ),
)
"""Name, file, what the stage does, what it passes on."""


def draw_step() -> None:
    """Draw images/step.svg."""
    tall, gap, left, width, side, side_width = 58, 32, 14, 512, 566, 320
    top = 54
    figure, axes = sheet(top + len(STAGES) * (tall + gap) + 24)
    middle = left + 150
    axes.text(left, 14, "Monitor.step(stamp_ns, ids or states, poses, twists, covariance)", weight="bold", size=10,
              va="center")  # fmt: skip
    arrow(axes, (middle, 24), (middle, top - 2))
    place = {}
    y = float(top)
    for name, file, text, passed in STAGES:
        place[file] = y
        box(axes, left, y, width, tall, STAGE)
        axes.text(left + 9, y + 14, name, weight="bold", size=10, va="center")
        axes.text(left + width - 9, y + 14, f"monitor/{file}", va="center", ha="right", color=QUIET, size=7.6)
        axes.text(left + 9, y + 26, text, va="top", linespacing=1.2)
        y += tall
        arrow(axes, (middle, y + 1), (middle, y + gap - 2))
        axes.text(middle + 10, y + gap / 2, passed, va="center", style="italic", color=INK)
        y += gap

    def aside(file: str, title: str, text: str, color: str, height: float, down: float = 0.0) -> float:
        at = place[file] + down
        box(axes, side, at, side_width, height, color)
        axes.text(side + 9, at + 13, title, weight="bold", size=9, va="center")
        axes.text(side + 9, at + 25, text, va="top", linespacing=1.2)
        return at + height / 2

    aside(
        "intake.py", "step_context.py: argument of most stages",
        "roster, profile, settings of the kernels, time and\nnumber of the step, counters of the work done.\n"
        "state/roster.py: ids and slots, shapes, bodies\n(arrays), allowed pairs. refusals.py: counts, texts",
        DATA, 84, -40,
    )  # fmt: skip
    at = aside(
        "tracking.py", "uncertain_predictions.py",
        "the declared uncertainties: widens the boxes of\nbodies (2), keeps the pairs that only uncertainty\n"
        "brings together (3), adds times and probabilities\nto the predictions (7)", BRANCH, 84, -18,
    )  # fmt: skip
    for file in ("tracking.py", "candidates.py"):
        arrow(axes, (side, at), (left + width + 1, place[file] + tall / 2))
    at = aside(
        "event_list.py", "time_critical.py, budget.py",
        "only with budget_ms or pairs_per_step: stage 4\ncomputes bounds only; pairs and events are worked\n"
        "on in order of urgency until the budget ends;\nthe other pairs are UNRESOLVED", BRANCH, 84, 34,
    )  # fmt: skip
    for file in ("event_list.py", "active_pairs.py"):
        arrow(axes, (side, at), (left + width + 1, place[file] + tall / 2))
    at = aside(
        "answers.py", "contacts/patches.py, filters.py, result.py",
        "corners of touching faces; filters of region and\nspeed; StepResult and StepStatus", DATA, 58,
    )  # fmt: skip
    arrow(axes, (side, at), (left + width + 1, at))
    # pairs that are certified apart for a while go back to the event list
    x = left + width - 120
    arrow(axes, (x, place["active_pairs.py"]), (x, place["event_list.py"] + tall + 1))
    axes.text(x + 8, place["event_list.py"] + tall + gap / 2, "certified apart", va="center", style="italic")
    figure.savefig(IMAGES / "step.svg", metadata={"Date": None})
    plt.close(figure)


if __name__ == "__main__":
    draw_floors()
    draw_step()
