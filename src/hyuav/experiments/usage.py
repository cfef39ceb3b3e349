"""The help of a recipe, short enough for one screen."""

import re
import shlex
import sys
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from textwrap import wrap
from typing import Any

from hyuav._support.program import program

WIDTH = 80


def usage(
    name: str,
    description: str,
    node: Mapping[str, Any],
    groups: Mapping[str, tuple[str, Collection[str]]],
    sections: Collection[str],
) -> str:
    """What a recipe does, how it is called, what can be set, and how to see all of it.

    Args:
        name: of the recipe.
        description: the docstring of its file: what it does, and at the end how it is called.
        node: the defaults of its configuration.
        groups: each group's default and all of its members.
        sections: the names of the sections.
    """
    as_package = Path(sys.argv[0]).stem == "__main__"  # python -m benchmarks
    call = f"hyuav {name}" if as_package else shlex.join(program())
    purpose, _, calls = description.strip().partition("\n\n")
    examples = calls.rpartition("\n\n")[2].replace(f"hyuav {name}", call)
    options = [key for key in node if key not in (*groups, *sections, "hydra", "defaults")]
    lines = [purpose, "", examples, "", "Set by NAME=VALUE; the defaults are:"]
    lines += _filled("  ", (f"{key}={_shown(node[key])}" for key in options))
    if groups:
        lines += ["", f"Chosen by a name, with fields such as {next(iter(groups))}.NAME=VALUE:"]
        for group, (member, members) in groups.items():
            others = ", ".join(own for own in members if own != member)
            lines += _filled(f"  {group}={member}".ljust(25), f"or {others}".split())
    if sections:
        lines += ["", "Set by SECTION.NAME=VALUE:"]
    for section in sections:
        lines += _filled(f"  {section}".ljust(14), ", ".join(node[section]).split())
    lines += ["", f"{call} --cfg job: all that can be set, with its value"]
    if node["hydra"]["run"]["dir"] != ".":
        lines.append(f"{call} -m NAME=VALUE,VALUE: a job for each value")
    return "\n".join([*lines, f"{call} --hydra-help: options besides"])


def _shown(value: object) -> str:
    """A value as the command line takes it; in a pattern, TIME for when the command is called."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{','.join(map(_shown, value))}]"
    return re.sub(r"\$\{now:[^}]*\}", "TIME", str(value))


def _filled(heading: str, words: Iterable[str]) -> list[str]:
    """Lines of words, behind a heading and below it."""
    return wrap(
        " ".join(words),
        WIDTH,
        initial_indent=heading,
        subsequent_indent=" " * len(heading),
        break_long_words=False,
        break_on_hyphens=False,
    )
