"""A user's own algorithms on the command line: ``algorithm=FILE.py:CLASS``, or an entry point."""

import re
import sys
from collections.abc import Sequence
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated

from pydantic import Field

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import Text
from hyuav.experiments.quoting import in_quotes
from hyuav.learning.registry import ALGORITHMS, INSTALLED, file_name, find, run_own

OwnAlgorithm = Annotated[Text, Field(pattern=r"\.py:\w+$", description="FILE.py:CLASS")]

_REFERENCE = re.compile(r"""(["'])(?P<quoted>.+?\.py:\w+)\1|[^\s,\[\]'"]+\.py:\w+""")

_AS_NAMED: dict[str, str] = {}
"""What Hydra calls them, and how the command line named them."""


def run_named(*, chosen: bool) -> list[str]:
    """Run the files that the command line names, and let Hydra read short names in their place.

    Args:
        chosen: whether an algorithm is chosen from a group; a list of them has the names that a
            run's configuration keeps.

    Returns:
        ``FILE.py:CLASS`` of each, with the file's whole path.

    Raises:
        InputError: there is no such file, class or package, or it fails.
    """
    references: list[str] = []
    _AS_NAMED.clear()

    def short(found: re.Match[str]) -> str:
        reference = found["quoted"] or found[0]
        path, _, kind = reference.rpartition(":")
        references.append(f"{Path(path).absolute()}:{kind}")
        name = run_own(reference)
        called = file_name(name) if chosen else name
        called = called if called.isascii() else in_quotes(called)
        _AS_NAMED[called] = found[0]
        return called

    installed = entry_points(group=INSTALLED).names
    for place, argument in enumerate(sys.argv):
        name, _, value = argument.partition("=")
        if name == "algorithm":
            if value.strip("\"'").endswith(".py"):
                raise InputError(rejection(name, value, f"a class in it too, {value}:CLASS"))
            for package in installed & set(re.findall(r"\w+", value)) - ALGORITHMS.keys():
                find(package)
            whole = f'"{value}"' if Path(value.rpartition(":")[0]).is_file() else value
            sys.argv[place] = f"{name}={_REFERENCE.sub(short, whole)}"
    return references


def with_own(overrides: Sequence[str]) -> list[str]:
    """Overrides for a call of the same recipe, which has to name the same files again."""
    own = ",".join(_AS_NAMED.values())
    if own and not any(each.startswith("algorithm=") for each in overrides):
        return [*overrides, f"algorithm={own if len(_AS_NAMED) == 1 else f'[{own}]'}"]
    return list(overrides)


def as_named(override: str) -> str:
    """An override as the command line named its files."""
    for called, reference in _AS_NAMED.items() if override.startswith("algorithm=") else ():
        whole = rf"(?<![\w.]){re.escape(called)}(?!\w)"
        override = re.sub(whole, reference.replace("\\", r"\\"), override)
    return override
