"""Rules as YAML: what is read, and what is refused with file, line and key."""

from __future__ import annotations

from pathlib import Path

import pytest

from collision_monitor.alerts.rules import Rules
from collision_monitor.errors import InputError

EXAMPLE = Path(__file__).parents[2] / "config/rules.yaml"
HEAD = 'classes: {cart: ["cart*", 7, {group: 4}], person: ["person_?"]}\nzones: {dock: {box: [[0, 0, 0], [1, 1, 1]]}}\n'


def refused(text: str) -> str:
    with pytest.raises(InputError) as caught:
        Rules.parse(text, "r.yaml")
    return str(caught.value)


def rule(content: str, head: str = HEAD) -> str:
    return f"{head}rules:\n  near:\n    {content}\n"


def test_the_example_is_read() -> None:
    rules = Rules.given(str(EXAMPLE))
    assert [each.name for each in rules.rules] == ["person near vehicle", "vehicle near vehicle"]
    assert rules.rules[0].raise_after == 100_000_000
    assert rules.longest_time == 2.0
    assert Rules.parse(rules.text).rules == rules.rules


@pytest.mark.parametrize("text", ["", "\n", "  \n"])
def test_a_blank_text_has_no_rules(text: str) -> None:
    assert not Rules.parse(text).rules


def test_members_of_a_class() -> None:
    cart = Rules.parse(rule("{between: [cart, any], caution: {distance: 1}}")).classes["cart"]
    assert cart.has(1, "cart_9", 1)
    assert cart.has(7, "x", 1)
    assert cart.has(1, "x", 6)
    assert not cart.has(1, "Cart", 3)
    assert not cart.has(1, "a cart", 1)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{between: [crt, person], caution: {distance: 1}}", "line 5, rules, near, between, 0: the class 'crt' is"),
        ("{between: [cart], caution: {distance: 1}}", "between: expected a list of 2, got ['cart']"),
        ("{between: cart, caution: {distance: 1}}", "between: expected two classes, or `any`, got 'cart'"),
        ("{B}", "expected at least one of caution, warning, critical with its thresholds, got none"),
        ("{B, caution: {}}", "expected a threshold of at least one of"),
        ("{B, caution: {distanc: 1}}", "the key 'distanc' is unknown: did you mean 'distance'?"),
        ("{B, caution: {distance: x}}", "expected a number of m from -1e+06 to 1e+06, got 'x'"),
        ("{B, caution: {probability: 2}}", "from 0 to 1, got 2"),
        ("{B, caution: {distance: .nan}}", "got nan"),
        ("{B, caution: {distance: 1}, critical: {distance: 2}}", "expected at most 1, the threshold of the lower"),
        ("{B, caution: {probability: 0.5}, warning: {probability: 0.2}}", "expected at least 0.5"),
        ("{B, caution: {time_to_closest_approach: 2}}", "expected distance_at_closest_approach beside it"),
        ("{B, caution: {separation_margin: 0}}", "only `separation_margin`"),
        ("{B, caution: {distance: 1}, S: {reaction_time: 1, deceleration: 2}}", "only `protective_separation`"),
        ("{B, caution: {separation_margin: 0}, S: {reaction_time: 1}}", "either stopping_time (s) or deceleration"),
        ("{B, caution: {distance: 1}, inside: [dok]}", "the zone 'dok' is unknown: did you mean 'dock'?"),
        ("{B, caution: {distance: 1}, inside: [dock], outside: [dock]}", "expected other zones than those of `inside`"),
        ("{B, caution: {distance: 1}, raise_after: -1}", "raise_after: expected a number of s from 0 to 3600, got -1"),
        ("{B, caution: {distance: 1}, quiet_at_rest: 1}", "expected true or false, got 1"),
        ("{caution: {distance: 1}}", "the key `between`"),
        ("[]", "expected a table with between"),
    ],
)  # fmt: skip
def test_a_rule_that_is_refused(content: str, said: str) -> None:
    text = refused(rule(content.replace("B", "between: [cart, person]", 1).replace("S:", "protective_separation:")))
    assert text.startswith("r.yaml, line ")
    assert said in text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rules: {}\nclases: {}", "line 2, clases: the key 'clases' is unknown: did you mean 'classes'?"),
        ("classes: {any: [x]}\nrules: {}", "'any' is every object"),
        ("classes: {a: []}\nrules: {}", "expected a list of 1 to 100"),
        ("classes: {a: [{group: -1}]}\nrules: {}", "a whole number"),
        ("classes: {a: [{}]}\nrules: {}", "a name, an id or {group: BITS}"),
        ("classes: {a: [true]}\nrules: {}", "a whole number"),
        ("allowed: [[a, b]]\nrules: {}", "the class 'a' is unknown"),
        ("zones: {a: {box: [[0, 0, 0], [1, 1, 0]]}}\nrules: {}", "with a volume between them"),
        ("zones: {a: {box: [[1, 1, 1], [0, 0, 0]]}}\nrules: {}", "the lower one first"),
        ("zones: {a: {polygon: [[0, 0], [1, 1], [2, 2]]}}\nrules: {}", "corners that enclose an area"),
        ("zones: {a: {polygon: [[0, 0], [2, 2], [2, 0], [0, 2]]}}\nrules: {}", "area"),
        ("zones: {a: {polygon: [[0, 0], [2, 3], [2, 0], [0, 2]]}}\nrules: {}", "does not cross itself"),
        ("zones: {a: {polygon: [[0, 0], [1, 0], [0, 1]], z: [1, 1]}}\nrules: {}", "a height between them"),
        ("zones: {a: {half_space: [0, 0, 0, 1]}}\nrules: {}", "a normal that is not zero"),
        ("zones: {a: {box: [[0, 0, 0], [1, 1, 1]], half_space: [0, 0, 1, 1]}}\nrules: {}", "one of box, polygon"),
        ("zones: {a: {sphere: 1}}\nrules: {}", "the key 'sphere' is unknown"),
        ("classes: {}", "expected a table `rules`"),
        ("rules: [", "expected YAML"),
        ("3", "expected a table"),
    ],
)  # fmt: skip
def test_a_file_that_is_refused(text: str, said: str) -> None:
    found = refused(text)
    assert found.startswith("r.yaml")
    assert said in found


def test_any_is_every_pair() -> None:
    texts = (rule(f"{{between: {each}, caution: {{distance: 1}}}}") for each in ("any", "[any, any]"))
    short, long = map(Rules.parse, texts)
    assert short.rules == long.rules and short.rules[0].between == ("any", "any")


def test_more_rules_than_a_step_may_evaluate_are_refused() -> None:
    many = "\n".join(f"  r{k}: {{between: [any, any], caution: {{distance: 1}}}}" for k in range(101))
    assert "at most 100, got 101" in refused(f"rules:\n{many}")


def test_the_parameter_is_a_path_or_the_yaml_itself(tmp_path: Path) -> None:
    text = "rules: {near: {between: [any, any], caution: {distance: 1}}}"
    (tmp_path / "r.yaml").write_text(text)
    assert Rules.given(str(tmp_path / "r.yaml")).rules == Rules.given(text).rules
    assert not Rules.given("").rules
    with pytest.raises(InputError, match="expected a YAML file, got nothing there"):
        Rules.given(str(tmp_path / "missing.yaml"))
