"""What a team expects of a session, as YAML, and whether it is so: regression tests from recordings.

Nothing is taken as true that the session does not show: where inputs or answers are missing, what must not have
happened counts as not known, and fails.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.session.history.history import ANY, History, Pair


@dataclass(frozen=True)
class Outcome:
    """One expectation: what it says, whether it holds, and what was there."""

    expectation: str
    holds: bool
    found: str


Check = Callable[[History, Callable[[], str]], tuple[bool, str]]


@dataclass(frozen=True)
class Expectation:
    """One expectation, checked: its text, and the function that looks whether it holds."""

    text: str
    check: Check


def read_expectations(path: str | Path) -> Any:
    """What a YAML file expects, for `parse_expectations`. Raises InputError, naming file, expectation and choices."""
    try:
        content = yaml.load(Path(path).read_text(encoding="utf-8"), _Loader)
    except OSError as error:
        raise InputError(f"{path}: expected a file that can be read, got: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path}: expected YAML, got: {' '.join(str(error).split())}") from None
    try:
        parse_expectations(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return content


class _Loader(yaml.SafeLoader):
    """Refuses a key that is there twice, where YAML would forget the first: an expectation less."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [key.value for key, _ in node.value]
        if len(set(map(str, keys))) < len(keys):
            raise yaml.constructor.ConstructorError(None, None, f"the same key twice in {keys}", node.start_mark)
        return super().construct_mapping(node, deep)


def parse_expectations(content: Any) -> list[Expectation]:
    """The expectations of what `yaml.safe_load` gives. Raises InputError."""
    if not isinstance(content, Mapping) or list(content) != ["expect"] or not isinstance(content["expect"], list):
        raise InputError(f"expected a list under the one key `expect`, got {content!r:.80}")
    if not content["expect"]:
        raise InputError("expected at least one expectation under `expect`, got none")
    return [_parse(k, each) for k, each in enumerate(content["expect"], start=1)]


def evaluate(expectations: list[Expectation], history: History, replay: Callable[[], str]) -> list[Outcome]:
    """The outcome of each. replay: runs the session again and returns its verdict, where an expectation asks for it."""
    outcomes = []
    for each in expectations:
        try:
            holds, found = each.check(history, replay)
        except CollisionMonitorError as error:
            holds, found = False, str(error)
        outcomes.append(Outcome(each.text, holds, found))
    return outcomes


# -- from YAML to checks

_KINDS: Final[dict[str, tuple[str, ...]]] = {
    "contact": ("between",),
    "no_contact": (),
    "no_prediction": ("under",),
    "warned": ("before",),
    "step_time_p99": (),
    "replay": (),
    "complete": (),
}


def _parse(number: int, item: Any) -> Expectation:
    what = f"expectation {number}"
    kinds = [key for key in item if key in _KINDS] if isinstance(item, Mapping) else []
    if len(kinds) != 1:
        raise InputError(f"{what}: expected one of {', '.join(_KINDS)}, got {item!r}")
    kind = kinds[0]
    unknown = set(item) - {kind, *_KINDS[kind]}
    if unknown:
        choices = ", ".join((kind, *_KINDS[kind]))
        raise InputError(f"{what}: expected only {choices}, got {', '.join(map(str, sorted(unknown, key=str)))}")
    text = ", ".join(f"{key}: {_shown(value)}" for key, value in item.items())
    match kind:
        case "contact":
            low, high = _window(item.get("between"), what)
            return Expectation(text, _contact(_names(item[kind], what), low, high))
        case "no_contact":
            return Expectation(text, _no_contact(_names(item[kind], what)))
        case "no_prediction":
            return Expectation(
                text, _no_prediction(_names(item[kind], what), _number(item.get("under", math.inf), what))
            )
        case "warned":
            return Expectation(text, _warned(_names(item[kind], what), _number(item.get("before"), what)))
        case "step_time_p99":
            return Expectation(text, _step_time(_number(item[kind], what)))
        case "replay":
            if item[kind] != "identical":
                raise InputError(f"{what}: replay: expected identical, got {item[kind]!r}")
            return Expectation(text, lambda history, replay: ((found := replay()) == "identical", found))
    if item[kind] is not True:
        raise InputError(f"{what}: complete: expected true, got {item[kind]!r}")
    return Expectation(text, _complete)


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    return str(value).lower() if isinstance(value, bool) else str(value)


Names = str | list[str | int]


def _names(value: Any, what: str) -> Names:
    if value == ANY or (isinstance(value, list) and len(value) == 2 and all(_is_name(name) for name in value)):
        return value  # type: ignore[no-any-return]
    raise InputError(f"{what}: expected two names or ids, [cart, 7], or {ANY}; got {value!r}")


def _is_name(value: Any) -> bool:
    return isinstance(value, str | int) and not isinstance(value, bool)


def _number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0.0:
        raise InputError(f"{what}: expected a number of seconds, at least 0, got {value!r}")
    return float(value)


def _window(value: Any, what: str) -> tuple[float, float]:
    if value is None:
        return 0.0, math.inf
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{what}: between: expected [from, to] in seconds, got {value!r}")
    low, high = _number(value[0], what), _number(value[1], what)
    if low > high:
        raise InputError(f"{what}: between: expected a window that does not end before it begins, got {value!r}")
    return low, high


# -- the checks


def _problems(history: History) -> str:
    """Why something may be missing; empty where all is there."""
    if not history.problems:
        return ""
    more = len(history.problems) - 1
    return f"not known: {history.problems[0]}" + (f", and {more} more" if more else "")


def _pair(history: History, pair: Pair) -> str:
    return f"{history.name_of(pair[0])} and {history.name_of(pair[1])}"


def _contact(names: Names, low: float, high: float) -> Check:
    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        collisions = [each for each in history.collisions_of(names) if each.certain]
        if not collisions:
            return False, _problems(history) or "no contact"
        first = collisions[0]
        return low <= first.begin <= high, f"first contact at {first.begin:.3f} s, {_pair(history, first.pair)}"

    return check


def _no_contact(names: Names) -> Check:
    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        for each in history.collisions_of(names):
            kind = "contact" if each.certain else "possible contact"
            return (
                False,
                f"{kind} at {each.begin:.3f} s, {_pair(history, each.pair)}, depth {max(-each.deepest, 0):.3g} m",
            )
        unseen = _unseen(history, names)
        if unseen:
            return False, f"not known: no state of {', '.join(unseen)}"
        return not history.problems, _problems(history) or "no contact"

    return check


def _unseen(history: History, names: Names) -> list[str]:
    """Names of the objects that are meant and that nothing was ever heard of."""
    ids = set(history.objects) if names == ANY else history.ids_of(names[0]) | history.ids_of(names[1])
    seen = set(history.states["id"].tolist())
    return sorted(history.name_of(i) for i in ids if i not in seen and not history.objects[i].static)


def _no_prediction(names: Names, under: float) -> Check:
    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        wanted = history.pairs_of(names)
        rows = history.predictions
        for k in np.flatnonzero(rows["lower"] < under):
            pair = (int(rows["id_a"][k]), int(rows["id_b"][k]))
            if wanted(pair):
                at = history.times[history.prediction_step[k]]
                return False, f"due in {rows['lower'][k]:.3f} s at {at:.3f} s, {_pair(history, pair)}"
        return not history.problems, _problems(history) or "no such prediction"

    return check


def _warned(names: Names, before: float) -> Check:
    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        collisions = history.collisions_of(names)
        least = math.inf
        for each in collisions:
            # what was there from the start could not be warned of
            if each.warned < before:
                return False, f"warned {each.warned:.3f} s before {each.begin:.3f} s, {_pair(history, each.pair)}"
            least = min(least, each.warned)
        if not collisions:
            return not history.problems, _problems(history) or "no contact"
        return not history.problems, _problems(
            history
        ) or f"{len(collisions)} contacts, warned {least:.3f} s before or more"

    return check


def _complete(history: History, _: Callable[[], str]) -> tuple[bool, str]:
    if history.problems:
        return False, _problems(history)
    if history.status is None:
        return False, "not known: the session holds no status"
    counters = asdict(history.status)
    names = [name for name in counters if name.startswith("refused_")] + ["messages_lost", "recording_dropped"]
    lost = [f"{name} {counters[name]}" for name in names if counters[name]]
    return not lost, ", ".join(lost) or "nothing is missing"


def _step_time(limit: float) -> Check:
    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        if not len(history.durations):
            return False, "not known: the session holds no step times"
        p99 = float(np.quantile(history.durations, 0.99))
        kind = "steps" if history.replayed else "steps that a status reported"
        return p99 <= limit, f"{p99:.6f} s over {len(history.durations)} {kind}"

    return check
