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
from hyuav.learning.registry import ALGORITHMS, INSTALLED, file_name, find, run_own

OwnAlgorithm = Annotated[Text, Field(pattern=r"\.py:\w+$", description="FILE.py:CLASS")]

_REFERENCE = re.compile(r"[^\s,\[\]'\"]+\.py:\w+")

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
        path, _, kind = found[0].rpartition(":")
        references.append(f"{Path(path).absolute()}:{kind}")
        name = run_own(found[0])
        called = file_name(name) if chosen else name
        _AS_NAMED[called] = found[0]
        return called

    installed = entry_points(group=INSTALLED).names
    for place, argument in enumerate(sys.argv):
        name, _, value = argument.partition("=")
        if name == "algorithm":
            if value.endswith(".py"):
                raise InputError(rejection(name, value, f"a class in it too, {value}:CLASS"))
            for package in installed & set(re.findall(r"\w+", value)) - ALGORITHMS.keys():
                find(package)
            sys.argv[place] = f"{name}={_REFERENCE.sub(short, value)}"
    return references


def with_own(overrides: Sequence[str]) -> list[str]:
    """Overrides for a call of the same recipe, which has to name the same files again."""
    own = list(_AS_NAMED.values())
    if own and not any(each.startswith("algorithm=") for each in overrides):
        return [*overrides, f"algorithm={own[0] if len(own) == 1 else own}"]
    return [_as_named(each) for each in overrides]


def _as_named(override: str) -> str:
    for called, reference in _AS_NAMED.items() if override.startswith("algorithm=") else ():
        override = re.sub(rf"(?<![\w.]){re.escape(called)}(?!\w)", reference, override)
    return override
