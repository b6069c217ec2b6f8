"""One HTML file that needs nothing else: the words and tables of a report around its pictures."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Final

from collision_monitor._version import VERSION
from collision_monitor.errors import SessionError
from collision_monitor.report.facts import Facts, gather
from collision_monitor.report.figures import EVENTS, PAIRS, as_png, as_svg, figures, pair_name
from collision_monitor.session.history import History

ROWS: Final = 200
"""Collisions in the table."""

CAPTIONS: Final = {
    "timeline": (
        "Timeline",
        "When pairs touched, and when they were predicted to: the riskiest pairs first.",
    ),
    "predicted": (
        "Predicted against actual",
        "For each collision that was predicted, how far off the predicted time was. The band is the interval that was "
        "stated; above zero it came too late.",
    ),
    "distances": (
        "The riskiest pairs",
        "Distance of the shapes, from the recorded states, and the time to collision that was predicted.",
    ),
    "events": (
        "From above",
        "The tracks from 2 s before to 2 s after the deepest collisions; footprints where the contact began.",
    ),
    "steps": ("Step times", "How long the monitor took, as its status said."),
}

STYLE: Final = """\
:root { color-scheme: light dark; --line: #8884; --card: #fff; --bad: #c0392b; --good: #2a8c4a; --warn: #b07800; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; margin: 0 0 .25rem; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 2rem 0 .25rem; }
p { margin: .25rem 0 .75rem; }
.verdict { border-left: .5rem solid var(--good); padding: .5rem 1rem; background: #8881; }
.verdict.bad { border-color: var(--bad); }
.verdict.unknown { border-color: var(--warn); }
.verdict strong { font-size: 1.25rem; }
.problem { color: var(--bad); }
figure { margin: 0; background: var(--card); border: 1px solid var(--line); border-radius: .4rem; padding: .5rem; }
figure { overflow-x: auto; }
figure svg { width: 100%; min-width: 36rem; height: auto; display: block; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .2rem .8rem .2rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td.number, th.number { text-align: right; }
td { overflow-wrap: anywhere; }
@media print { figure, table { break-inside: avoid; } }
"""


def write_report(
    history: History, path: str | Path, *, pictures: str | Path | None = None, overwrite: bool = False
) -> list[Path]:
    """Write the report, and with `pictures` its figures as PNG into that folder; returns what was written.

    Raises SessionError where a file is there already and not to be overwritten, or cannot be written.
    """
    facts = gather(history)
    drawn = figures(history, facts)
    files = {Path(path): page(history, facts, {name: as_svg(figure) for name, figure in drawn.items()}).encode()}
    if pictures is not None:
        files |= {Path(pictures) / f"{name}.png": as_png(figure) for name, figure in drawn.items()}
    there = [file for file in files if file.exists()]
    if there and not overwrite:
        raise SessionError(f"{there[0]}: expected a new file, got one that exists; choose another name or --force")
    try:
        if pictures is not None:
            Path(pictures).mkdir(parents=True, exist_ok=True)
        for file, content in files.items():
            file.write_bytes(content)
    except OSError as error:
        raise SessionError(f"{error.filename}: expected to be able to write there, got: {error.strerror}") from None
    return list(files)


def page(history: History, facts: Facts, pictures: dict[str, str]) -> str:
    """The whole page; pictures: SVG elements by the names of CAPTIONS."""
    sections = [_verdict(history, facts)]
    for name, (title, caption) in CAPTIONS.items():
        if name in pictures:
            note = _left_out(name, facts)
            sections.append(f"<h2>{title}</h2>\n<p>{caption}{note}</p>\n<figure>{pictures[name]}</figure>")
        if name == "timeline":
            sections.append(_table(history, facts))
    sections.append(_provenance(history))
    title = escape(history.name)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<style>\n{STYLE}</style>\n</head>\n'
        f"<body>\n<h1>{title}</h1>\n" + "\n".join(sections) + "\n</body>\n</html>\n"
    )


def _plural(count: int, what: str) -> str:
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"


def _verdict(history: History, facts: Facts) -> str:
    """First what a reader has to know, and whether it can be relied on."""
    count = len(facts.collisions)
    lines = []
    if facts.warned:
        lines.append(
            f"{len(facts.warned)} of them {'was' if len(facts.warned) == 1 else 'were'} predicted, "
            f"{facts.quickest:.2f} s ahead or more"
        )
    if facts.surprises:
        lines.append(f"{len(facts.surprises)} came without a prediction right before")
    there = count - len(facts.warned) - len(facts.surprises)
    if there:
        lines.append(f"{there} {'was' if there == 1 else 'were'} there from the first step on")
    if facts.false:
        lines.append(f"{_plural(len(facts.false), 'pair')} predicted to touch did not: the objects moved otherwise")
    if facts.possible:
        lines.append(f"{_plural(len(facts.possible), 'further contact')} could not be excluded")
    if history.status is not None:
        status = history.status
        refused = sum(getattr(status, name) for name in vars(status) if name.startswith("refused_"))
        if refused:
            lines.append(f"{_plural(refused, 'input')} refused; the last for: {status.last_refusal}")
        if status.messages_lost:
            lines.append(f"{_plural(status.messages_lost, 'message')} lost on the way to the monitor")
        if status.recording_dropped:
            lines.append(f"{_plural(status.recording_dropped, 'message')} could not be recorded")
    unknown = bool(history.problems or facts.possible)
    kind = "bad" if count else "unknown" if unknown else "good"
    answer = _plural(count, "collision").capitalize() if count or not unknown else "No collision is known of"
    moving = sum(not each.static for each in history.objects.values())
    extent = f"{history.duration:.1f} s, {_plural(len(history.times), 'step')}, {_plural(moving, 'moving object')}"
    source = "today's answers to the recorded inputs" if history.replayed else "as recorded"
    problems = "".join(f'<p class="problem">Not all is known: {escape(each)}</p>\n' for each in history.problems[:5])
    if len(history.problems) > 5:
        problems += f'<p class="problem">and {len(history.problems) - 5} more</p>\n'
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return (
        f'<div class="verdict {kind}"><strong>{answer}</strong> in {extent}, {source}, profile '
        f"{escape(history.profile.name)}.\n{problems}<ul>{items}</ul></div>"
    )


def _left_out(name: str, facts: Facts) -> str:
    if name == "timeline" and len(facts.risky) > PAIRS:
        return f" {len(facts.risky) - PAIRS} more are left out."
    if name == "events" and len(facts.collisions) > EVENTS:
        return f" {len(facts.collisions) - EVENTS} more are left out."
    return ""


def _table(history: History, facts: Facts) -> str:
    if not facts.collisions:
        return ""
    rows = []
    for each in facts.collisions[:ROWS]:
        end = "goes on" if each.end is None else f"{each.end:.3f}"
        warned = "from the start" if each.warned != each.warned else f"{each.warned:.3f}" if each.warned else "no"
        cells = [f"{each.begin:.3f}", end, f"{max(-each.deepest, 0.0):.4g}", warned]
        numbers = "".join(f'<td class="number">{cell}</td>' for cell in cells)
        rows.append(f"<tr><td>{escape(pair_name(history, each.pair))}</td>{numbers}</tr>")
    heads = "".join(f'<th class="number">{head}</th>' for head in ("begin (s)", "end (s)", "depth (m)", "warned (s)"))
    more = f"<p>{len(facts.collisions) - ROWS} more are left out.</p>" if len(facts.collisions) > ROWS else ""
    return (
        '<h2>Collisions</h2>\n<div class="scroll"><table>\n<tr><th>pair</th>'
        f"{heads}</tr>\n" + "\n".join(rows) + f"\n</table></div>{more}"
    )


def _provenance(history: History) -> str:
    settings = {key: value for key, value in history.profile.to_dict().items() if key != "name"}
    facts = {key: value for key, value in sorted(history.metadata.items()) if key != "profile"}
    facts["profile"] = f"{history.profile.name}: " + ", ".join(f"{key} {value:g}" for key, value in settings.items())
    if history.status is not None:
        facts["digest at the last status"] = f"{history.status.digest:016x}"
    facts["first step (ns)"] = str(history.begin_ns)
    facts["report by"] = f"collision_monitor {VERSION}"
    rows = "\n".join(f"<tr><th>{escape(key)}</th><td>{escape(str(value))}</td></tr>" for key, value in facts.items())
    return f'<h2>Provenance</h2>\n<div class="scroll"><table>\n{rows}\n</table></div>'
