"""A user's own algorithms and rewards on the command line: ``FILE.py:NAME``, or an entry point."""

import re
import sys
from collections import defaultdict
from collections.abc import Sequence
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import Text
from hyuav._support.registry import Registry, file_name
from hyuav.envs.rewards import REWARDS
from hyuav.experiments.quoting import in_quotes
from hyuav.learning.registry import ALGORITHMS

OwnAlgorithm = Annotated[Text, Field(pattern=r"\.py:\w+$", description="FILE.py:CLASS")]
OwnReward = Annotated[Text, Field(pattern=r"\.py:\w+$", description="FILE.py:NAME")]

Named = tuple[str, str]
"""A field, and the ``FILE.py:NAME`` that it is set to."""

_REFERENCE = re.compile(r"""(["'])(?P<quoted>.+?\.py:\w+)\1|[^\s,\[\]'"]+\.py:\w+""")

_REGISTRIES: tuple[tuple[Registry[Any], str], ...] = ((ALGORITHMS, "a class"), (REWARDS, "a name"))
"""And what is looked up in a file."""

_AS_NAMED: dict[str, dict[str, str]] = defaultdict(dict)
"""By field, what Hydra calls them, and how the command line named them."""


def run_named(*, chosen: bool) -> list[Named]:
    """Run the files that the command line names, and let Hydra read short names in their place.

    Args:
        chosen: whether an algorithm is chosen from a group; a list of them has the names that a
            run's configuration keeps.

    Returns:
        what :func:`run_again` takes, with the files' whole paths.

    Raises:
        InputError: there is no such file, name in it or package, or it fails.
    """
    named: list[Named] = []
    _AS_NAMED.clear()

    def short(registry: Registry[Any], found: re.Match[str]) -> str:
        reference, field = found["quoted"] or found[0], registry.field
        named.append((field, _whole(reference)))
        name = registry.run_own(reference)
        called = file_name(name) if chosen and field == "algorithm" else name
        called = called if called.isascii() else in_quotes(called)
        _AS_NAMED[field][called] = found[0]
        return called

    for place, argument in enumerate(sys.argv):
        field, _, value = argument.partition("=")
        for registry, what in _REGISTRIES:
            if field != registry.field:
                continue
            if value.strip("\"'").endswith(".py"):
                accepted = f"{what} in it too, {value}:{what.split()[1].upper()}"
                raise InputError(rejection(field, value, accepted))
            for package in _offered(registry) & set(re.findall(r"\w+", value)):
                registry.find(package)
            whole = f'"{value}"' if Path(value.rpartition(":")[0]).is_file() else value
            sys.argv[place] = f"{field}={_REFERENCE.sub(partial(short, registry), whole)}"
    return named


def run_again(named: Sequence[Named]) -> None:
    """Run what :func:`run_named` ran, in a process that may not have done so yet."""
    registries = {registry.field: registry for registry, _ in _REGISTRIES}
    for field, reference in named:
        registries[field].run_own(reference)


def _offered(registry: Registry[Any]) -> set[str]:
    """By installed packages, and not loaded yet."""
    return entry_points(group=registry.group).names - registry.keys()


def _whole(reference: str) -> str:
    path, _, own = reference.rpartition(":")
    return f"{Path(path).absolute()}:{own}"


def with_own(overrides: Sequence[str]) -> list[str]:
    """Overrides for a call of the same recipe, which has to name the same files again."""
    told = list(overrides)
    for field, named in _AS_NAMED.items():
        own = ",".join(named.values())
        if own and not any(each.startswith(f"{field}=") for each in overrides):
            told.append(f"{field}={own if len(named) == 1 else f'[{own}]'}")
    return told


def as_named(override: str) -> str:
    """An override as the command line named its files."""
    for called, reference in _AS_NAMED.get(override.partition("=")[0], {}).items():
        whole = rf"(?<![\w.]){re.escape(called)}(?!\w)"
        override = re.sub(whole, reference.replace("\\", r"\\"), override)
    return override
