"""Hostile input: values that break programs, files that are damaged, and an account of both."""

import string
from collections import Counter
from collections.abc import Callable
from typing import Any, TypeVar

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from hyuav._support.errors import InputError

Result = TypeVar("Result")

TRIED: Counter[tuple[str, str]] = Counter()
"""How many inputs of each kind worked and how many were refused, in this process."""

CASES = {
    "scenario": 2500,
    "extreme scenario": 300,
    "YAML file": 1200,
    "configuration": 1200,
    "options": 2200,
    "command line": 60,
    "checkpoint, bytes": 600,
    "checkpoint, content": 200,
    "checkpoint, resumed": 300,
    "metrics": 300,
    "evaluation": 500,
    "flights": 100,
    "run directory": 30,
    "name": 1210,
}
"""Of each kind at least, in one run."""


def fuzz(kind: str) -> settings:
    """The settings of a test that tries inputs of a kind."""
    suppressed = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
    return settings(
        max_examples=CASES[kind] + CASES[kind] // 20,
        suppress_health_check=[*suppressed, HealthCheck.data_too_large],
    )


def attempt(kind: str, action: Callable[[], Result]) -> Result | None:
    """What the action gives, or None where it refuses in one line; anything else fails."""
    try:
        result = action()
    except InputError as error:
        require_one_line(str(error))
        TRIED[kind, "refused"] += 1
        return None
    TRIED[kind, "worked"] += 1
    return result


def require_one_line(message: str) -> None:
    """A message is a line of a length that a person reads, and nothing that a terminal obeys."""
    assert message
    assert len(message) < 1500, message
    assert all(character.isprintable() for character in message), message


PAYLOADS = (
    *("<script>alert(1)</script>", "<img src=x onerror=alert(1)>", "</script>", "javascript:1"),
    *("../../etc/passwd", "/etc/passwd", "..", "a/../../b", "~/x", "C:\\x", "\\\\host\\share"),
    *("${oc.env:HOME}", "${", "$(touch x)", "`id`", "; rm -rf x", "{{7*7}}", "%s%n", "???"),
    *("!!python/object/apply:os.system [true]", "__import__('os')", "=1+1", "a\nb", "a\rb"),
    *("\x00", "\x1b[2J", "\u202eabc", "\ud800", "\ufeff", "\u2028", "é" * 300, "x" * 5000, "", " "),
    *("NaN", "inf", "-0", "0x10", "1e999", "null", "true", "[red]x[/red]", "[/]", "'", '"', ","),
)
"""Text that means something to a shell, a page, a path, a template, a terminal or a parser."""

NUMBERS = (
    *(0, -0.0, 1, -1, 0.5, 2, 10, 1e-30, 1e-9, 1e9, 1e30, 1e39, -1e39, 1e-300, 1e300, 5e-324),
    *(2**31, 2**63 - 1, 2**63, 2**64, 10**12, 10**400, -(10**400), 10**4000),
    *(float("nan"), float("inf"), float("-inf"), True, False),
)

texts = st.sampled_from(PAYLOADS) | st.text(max_size=20)
numbers = st.sampled_from(NUMBERS) | st.floats() | st.integers()
scalars = st.none() | numbers | texts | st.binary(max_size=8)
anything = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4),
    max_leaves=6,
)


def damaged(values: dict[str, Any], entries: int = 3) -> st.SearchStrategy[dict[str, Any]]:
    """Values of which a few are replaced, left out or joined by others."""
    known = st.sampled_from(sorted(values)) if values else texts
    near = st.sampled_from([0.0, 1.0, -1.0, 1e-6, 1e6, 0.1, 10.0]).map(lambda factor: factor)
    replaced = st.dictionaries(known, anything | near, max_size=entries)
    added = st.dictionaries(texts, anything, max_size=1)
    left_out = st.sets(known, max_size=1)
    return st.builds(
        lambda changed, more, without: {
            name: value
            for name, value in {**values, **changed, **more}.items()
            if name not in without or name in changed
        },
        replaced,
        st.just({}) | st.just({}) | st.just({}) | added,
        st.just(set()) | st.just(set()) | left_out,
    )


def mutated(content: bytes) -> st.SearchStrategy[bytes]:
    """Bytes cut off, overwritten, doubled or joined by others."""
    place = st.integers(0, max(len(content) - 1, 0))
    piece = st.binary(min_size=1, max_size=8) | st.sampled_from(
        [payload.encode("utf-8", "surrogatepass") for payload in PAYLOADS]
    )
    edits = st.lists(st.tuples(st.sampled_from("ciod"), place, piece), min_size=1, max_size=4)

    def apply(changes: list[tuple[str, int, bytes]]) -> bytes:
        result = content
        for kind, at, new in changes:
            match kind:
                case "c":
                    result = result[:at]
                case "i":
                    result = result[:at] + new + result[at:]
                case "o":
                    result = result[:at] + new + result[at + len(new) :]
                case _:
                    result = result[:at] + result[max(at - 64, 0) :]
        return result

    return edits.map(apply)


file_names = st.text(string.printable, min_size=1, max_size=20) | st.sampled_from(PAYLOADS)
