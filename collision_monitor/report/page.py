"""The HTML page of a report: a single file with its sentences, tables and figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from html import escape
from pathlib import Path
from typing import Any, Final

from collision_monitor._version import VERSION
from collision_monitor.errors import SessionError
from collision_monitor.report.alert_bars import alert_caption, alert_table
from collision_monitor.report.assessment import assess, counted
from collision_monitor.report.captions import captions
from collision_monitor.report.facts import ReportFacts, gather
from collision_monitor.report.figures import figures
from collision_monitor.report.plans_from_above import plan_table
from collision_monitor.report.rendering import BROAD, NARROW, as_png, as_svg
from collision_monitor.session.history.history import CollisionEvent, History
from collision_monitor.session.output_file import check_output

ROWS: Final = 200
"""Largest number of collisions in the table."""

SWITCHES: Final = 10
"""Largest number of changed settings that are listed."""

PICTURES: Final = {
    "timeline": "Timeline",
    "alerts": "Alerts",
    "predicted": "Predicted against actual",
    "distances": "The riskiest pairs",
    "events": "From above",
    "plans": "Plans",
    "steps": "Step times",
}
"""Titles of the figures, by the names that `figures` and `captions` use, in their order on the page."""

NOTHING_ELSE: Final = "default-src 'none'; style-src 'unsafe-inline'"
"""Content security policy. The page runs no script and loads nothing, even if a name contains HTML."""

STYLESHEET: Final = """\
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #fff; --soft: #f3f4f6; --line: #d5d9de;
  --bad: #c0392b; --good: #2a8c4a; --unknown: #b07800; }
@media screen and (prefers-color-scheme: dark) { :root { --ink: #e4e7eb; --paper: #14171a; --soft: #1f2429;
  --line: #3a4149; --bad: #ff7b6b; --good: #5fc980; --unknown: #e5b04b; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 50rem;
  margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.4rem; margin: 0 0 .75rem; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 2.25rem 0 .25rem; }
p { margin: .25rem 0 .75rem; }
ul { margin: .5rem 0 0; padding-left: 1.25rem; }
.verdict { border-left: .5rem solid var(--bad); padding: .75rem 1rem; background: var(--soft);
  overflow-wrap: anywhere; }
.verdict.clear { border-color: var(--good); }
.verdict.unknown { border-color: var(--unknown); }
.verdict strong { display: block; font-size: 1.5rem; line-height: 1.25; }
.doubts { color: var(--unknown); }
.bad { color: var(--bad); font-weight: 600; }
figure { margin: 0; }
figure svg { width: 100%; height: auto; display: block; }
.narrow { display: none; }
@media screen and (max-width: 36rem) { .narrow { display: block; } .broad { display: none; } }
.scroll { overflow: auto; max-height: 28rem; }
.scroll tr:first-child th { position: sticky; top: 0; background: var(--paper); }
table { border-collapse: collapse; width: 100%; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
.number { text-align: right; white-space: nowrap; }
.number:last-child { padding-right: 0; }
td:not(.number) { overflow-wrap: anywhere; min-width: 7rem; }
@media print { body { max-width: none; } .scroll { max-height: none; } h2, p { break-after: avoid; }
  figure, tr, .verdict { break-inside: avoid; } }
"""


def write_report(
    history: History,
    path: str | Path,
    *,
    pictures: str | Path | None = None,
    overwrite: bool = False,
) -> list[Path]:
    """Write the report, and its figures as PNG into the folder `pictures`. Return the paths of the written files.

    Raises SessionError if a file exists and `overwrite` is false, or if a file cannot be written.
    """
    check_report(Path(path), None if pictures is None else Path(pictures), overwrite=overwrite)
    facts = gather(history)
    broad, narrow = figures(history, facts, BROAD), figures(history, facts, NARROW)
    drawn = {
        name: "".join(
            f'<div class="{size.name}">{as_svg(figure, f"{name}-{size.name}")}</div>'
            for size, figure in ((BROAD, broad[name]), (NARROW, narrow[name]))
        )
        for name in broad
    }
    try:
        if pictures is not None:
            Path(pictures).mkdir(exist_ok=True)
    except OSError as error:
        raise SessionError(f"{pictures}: expected to be able to write there, got: {error.strerror}") from None
    files = {Path(path): page(history, facts, drawn).encode("utf-8", errors="replace")}
    if pictures is not None:
        files |= {Path(pictures) / f"{name}.png": as_png(figure) for name, figure in broad.items()}
    for file, content in files.items():
        try:
            file.write_bytes(content)
        except OSError as error:  # one of writing, such as a full disk, names no file
            raise SessionError(f"{file}: expected to be able to write there, got: {error.strerror}") from None
    return list(files)


def check_report(
    path: Path, pictures: Path | None = None, *, overwrite: bool = False, inputs: Iterable[Path] = ()
) -> None:
    """Check before the work that the report may be written; inputs: as in `check_output`. Raises SessionError."""
    read = list(inputs)
    check_output(path, overwrite=overwrite, inputs=read)
    if pictures is None:
        return
    if pictures.is_dir():
        for name in PICTURES:
            check_output(pictures / f"{name}.png", overwrite=overwrite, inputs=read)
    elif pictures.exists():
        raise SessionError(f"{pictures}: expected a folder for the pictures, got a file")
    else:
        check_output(pictures, overwrite=overwrite, inputs=read)


def page(history: History, facts: ReportFacts, pictures: dict[str, str]) -> str:
    """Return the whole page. pictures: HTML of the figures, by the names that `figures` uses."""
    said = captions(history, facts)
    drawn = {name: _section(title, said[name], pictures.get(name)) for name, title in PICTURES.items()}
    alerts = drawn["alerts"] + alert_table(history) if drawn["alerts"] else _without_alerts(history)
    drawn["plans"] += plan_table(history)
    above = [_verdict(history, facts), _unmonitored(history), drawn["timeline"], alerts, _collisions(history, facts)]
    below = [part for name, part in drawn.items() if name not in ("timeline", "alerts")]
    sections = [*above, *below, _provenance(history)]
    title = escape(history.name)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{NOTHING_ELSE}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>\n{STYLESHEET}</style>\n</head>\n"
        f"<body>\n<h1>{title}</h1>\n" + "\n".join(filter(None, sections)) + "\n</body>\n</html>\n"
    )


def _section(title: str, caption: str, picture: str | None) -> str:
    return f"<h2>{title}</h2>\n<p>{caption}</p>\n<figure>{picture}</figure>" if picture else ""


def _without_alerts(history: History) -> str:
    return f"<h2>Alerts</h2>\n<p>{alert_caption(history)}</p>" if history.rules.rules else ""


def _verdict(history: History, facts: ReportFacts) -> str:
    """Return the headline of the page, with its findings and doubts."""
    found = assess(history, facts)
    moving = sum(not each.static for each in history.objects.values())
    source = "today's answers to the recorded inputs" if history.replayed else "as recorded"
    extent = (
        f"in {history.duration:.1f} s, {counted(len(history.times), 'step')}, {counted(moving, 'moving object')}, "
        f"profile {escape(history.profile.name)}{_switched(history)}, {source}"
    )
    doubts = ""
    if found.doubts:
        doubts = f'<p class="doubts">There may be more collisions, because:</p>\n{_list(found.doubts, "doubts")}\n'
    return (
        f'<div class="verdict {found.kind}"><strong>{found.answer}</strong> {extent}\n'
        f"{_list(found.findings, 'findings')}\n{doubts}</div>"
    )


def _switched(history: History) -> str:
    """Return how the profile changed during the session."""
    names = [str(changed["profile"]) for _, changed in history.settings if "profile" in changed]
    if names:
        return f", then {escape(', then '.join(names[:SWITCHES]))}{' and more' if len(names) > SWITCHES else ''}"
    return ", with changed settings" if history.settings else ""


def _list(sentences: list[str], name: str) -> str:
    items = "".join(f"<li>{escape(each)}</li>" for each in sentences)
    return f'<ul class="{name}">{items}</ul>' if items else ""


# -- tables

_COLUMNS: Final[tuple[tuple[str, Callable[[CollisionEvent, ReportFacts], str]], ...]] = (
    ("began<br>(s)", lambda each, facts: f"{each.begin:.3f}"),
    ("ended<br>(s)", lambda each, facts: f"after {each.last:.3f}" if each.end is None else f"{each.end:.3f}"),
    ("depth<br>(m)", lambda each, facts: f"{max(-each.deepest, 0.0):.3g}"),
    ("warned<br>(s before)", lambda each, facts: _warned(each)),
    ("first stated<br>(s)", lambda each, facts: _stated(each, facts)),
)


def _warned(collision: CollisionEvent) -> str:
    if math.isnan(collision.warned):
        return "at start"
    return f"{collision.warned:.3f}" if collision.warned else '<span class="bad">not</span>'


def _stated(collision: CollisionEvent, facts: ReportFacts) -> str:
    if collision not in facts.answered:
        return "–"
    low, high = facts.answered[collision].first_stated
    return f"{low:.3f} … {high:.3f}" if math.isfinite(high) else f"{low:.3f} or later"


def _collisions(history: History, facts: ReportFacts) -> str:
    if not facts.collisions:
        return ""
    rows = []
    for each in facts.collisions[:ROWS]:
        names = " – ".join(f"<bdi>{escape(history.name_of(object_id))}</bdi>" for object_id in each.pair)
        cells = "".join(f'<td class="number">{text(each, facts)}</td>' for _, text in _COLUMNS)
        rows.append(f"<tr><td>{names}</td>{cells}</tr>")
    heads = "".join(f'<th class="number">{head}</th>' for head, _ in _COLUMNS)
    left = len(facts.collisions) - ROWS
    out = f"<p>The first {ROWS}; {left} more left out.</p>" if left > 0 else ""
    return (
        "<h2>Collisions</h2>\n<p>Times count from the first step. Warned: how long before the contact its predictions "
        'began. First stated: the time of contact by the first prediction.</p>\n<div class="scroll"><table>\n'
        "<tr><th>pair</th>"
        f"{heads}</tr>\n" + "\n".join(rows) + f"\n</table></div>{out}"
    )


def _unmonitored(history: History) -> str:
    """Return the table of what the sources file asked for and was not monitored."""
    lasting = [each for each in history.unmonitored if each.is_lasting]
    if not lasting:
        return ""
    rows = []
    for each in lasting[:ROWS]:
        begin = "start" if each.begin <= 0.0 else f"{each.begin:.1f}"
        end = "end" if each.end is None else f"{each.end:.1f}"
        times = f'<td class="number">{begin}</td><td class="number">{end}</td>'
        rows.append(f"<tr><td><bdi>{escape(each.text)}</bdi></td>{times}</tr>")
    left = len(lasting) - ROWS
    out = f"<p>The first {ROWS}; {left} more left out.</p>" if left > 0 else ""
    return (
        "<h2>Not monitored</h2>\n<p>What the sources file asks for and was not there, so that no answer covers it. "
        'Times count from the first step.</p>\n<div class="scroll"><table>\n'
        '<tr><th>what</th><th class="number">from<br>(s)</th><th class="number">to<br>(s)</th></tr>\n'
        + "\n".join(rows)
        + f"\n</table></div>{out}"
    )


def _provenance(history: History) -> str:
    settings = {key: value for key, value in history.profile.to_dict().items() if key != "name"}
    changes = [f"at {time:.3f} s: {_settings_text(changed)}" for time, changed in history.settings]
    if len(changes) > SWITCHES:
        changes[SWITCHES:] = [f"{len(changes) - SWITCHES} more left out"]
    facts = {key: value for key, value in sorted(history.metadata.items()) if key != "profile"}
    if history.rules.rules:
        facts["rules"] = ", ".join(each.name for each in history.rules.rules)
    facts["profile"] = f"{history.profile.name}: {_settings_text(settings)}"
    if changes:
        facts["settings changed"] = "; ".join(changes)
    if history.status is not None:
        facts["digest at the last status"] = f"{history.status.digest:016x}, step {history.status.step}"
    facts["first step"] = f"{history.begin_ns} ns"
    facts["report by"] = f"collision_monitor {VERSION}"
    rows = "\n".join(
        f"<tr><th>{escape(key.replace('_', ' '))}</th><td>{escape(str(value))}</td></tr>"
        for key, value in facts.items()
    )
    return f'<h2>Provenance</h2>\n<table class="facts">\n{rows}\n</table>'


def _settings_text(settings: dict[str, Any]) -> str:
    settings = {**settings, "rules": "changed"} if "rules" in settings else settings
    texts = {key: f"{value:g}" if isinstance(value, float) else str(value) for key, value in settings.items()}
    return ", ".join(f"{key} {text}" for key, text in texts.items())
