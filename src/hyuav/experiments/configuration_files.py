"""The user's YAML files for Hydra as data: nothing in them is run, looked up or obeyed."""

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

from hydra.core.config_store import ConfigStore
from hydra.main import get_args_parser  # type: ignore[attr-defined]

from hyuav._support.errors import InputError, brief, rejection
from hyuav._support.yaml_files import read_yaml

ORDERS = ("defaults", "hydra", "_target_")
"""Names under which Hydra takes orders: what else to read, where to write, what to call."""

Complete = Callable[[str, str, dict[str, Any]], dict[str, Any]]
"""Adds to the values of a file, a group's member of a name, the defaults of what it leaves out."""

_PATH = re.compile(r"""(["'])(?P<quoted>.+?\.ya?ml)\1|[^\s,\[\]()*'"]+\.ya?ml""")

_CHOSEN: dict[str, str] = {}
"""Overrides that choose a file by the name that Hydra knows, and as they were typed."""

_SEARCHED: list[str] = []
"""The option that names the directory of files, where there is one."""


def choosing_files(overrides: Sequence[str]) -> list[str]:
    """Overrides of a job as words of a command line, which chooses the same files."""
    return [*_SEARCHED, *(_CHOSEN.get(each, each) for each in overrides)]


def read_files_as_data(groups: Iterable[str], complete: Complete) -> None:
    """Put the files that the command line chooses into Hydra's store, and let it see no directory.

    Hydra would let a file call any function (``hydra.callbacks``), write anywhere
    (``hydra.run.dir``) and copy the environment (``${oc.env:...}``), which is not to be expected of
    a scenario that somebody sent.

    Args:
        groups: whose members may be files, ``DIR/GROUP/NAME.yaml`` or any that is named by its
            path, ``GROUP=FILE.yaml``.
        complete: what the files hold.

    Raises:
        InputError: no such directory, a chosen file that cannot be read or holds more than plain
            values, or an option that Hydra does not know.
    """
    parser = get_args_parser()
    parser.error = _refuse  # type: ignore[method-assign]
    options = vars(parser.parse_intermixed_args(sys.argv[1:]))
    overrides = options.pop("overrides")
    searched = any(each.lstrip("+~").startswith("hydra.searchpath") for each in overrides)
    if searched or options["config_path"]:
        raise InputError("files are read from --config-dir DIR alone")
    directory = options.pop("config_dir")
    _SEARCHED[:] = [] if directory is None else ["--config-dir", directory]
    _CHOSEN.clear()
    for group in groups:
        if directory is not None:
            _store_members(Path(directory), group, overrides, complete)
        members = None if directory is None else Path(directory) / group
        overrides = [_with_paths_stored(each, group, members, complete) for each in overrides]
    sys.argv[1:] = overrides
    for name, value in options.items():
        if value is not None and value is not False:
            option = f"--{name.replace('_', '-')}"
            sys.argv.append(option if value is True else f"{option}={value}")


def _refuse(message: str) -> NoReturn:
    """Answer in one line, without the usage that Hydra would print first."""
    hint = " (NAME=VALUE is written without dashes)" if "unrecognized" in message else ""
    raise InputError(f"{message}{hint}")


def _with_paths_stored(override: str, group: str, members: Path | None, complete: Complete) -> str:
    """An override in which the names of members stand for the paths of files.

    Args:
        override: any of the command line.
        group: whose members it may choose.
        members: directory of files that are members already.
        complete: what a file holds.
    """
    name, _, value = override.partition("=")
    if name.lstrip("+") != group:
        return override

    def stored(found: re.Match[str]) -> str:
        path = Path(found["quoted"] or found[0])
        if members is not None and (members / path).is_file():
            return found[0]
        member = re.sub(r"^(?=[0-9])|[^0-9A-Za-z_-]+", "_", path.stem)
        typed = f"{group}={found[0]}"
        if _CHOSEN.setdefault(f"{group}={member}", typed) != typed:
            raise InputError(rejection(group, value, "files of different names"))
        node = {"name": member, **complete(group, member, _read(path))}
        ConfigStore.instance().store(group=group, name=member, node=node)
        return member

    whole = f'"{value}"' if _PATH.search(value) and Path(value).is_file() else value
    return f"{name}={_PATH.sub(stored, whole)}"


def _store_members(
    directory: Path, group: str, overrides: Iterable[str], complete: Complete
) -> None:
    """Offer the files of a group; one that is not chosen may be whatever it is."""
    if not directory.is_dir():
        raise InputError(rejection("--config-dir", str(directory), "a directory"))
    values = [
        each.partition("=")[2] for each in overrides if each.lstrip("+").startswith(f"{group}=")
    ]
    chosen = {word for value in values for word in re.split(r"[\s,\[\]'\"()]+", value)}
    for path in sorted((directory / group).rglob("*.yaml")):
        place = path.relative_to(directory / group).with_suffix("")
        try:
            node = complete(group, str(place), _read(path))
        except InputError:
            if chosen & {str(place), f"{place}.yaml", "glob"}:
                raise
            continue
        within = "/".join([group, *place.parts[:-1]])
        ConfigStore.instance().store(group=within, name=place.name, node=node, package=group)


def _read(path: Path) -> dict[str, Any]:
    """Names with plain values, as :meth:`.Parameters.save` writes them."""
    try:
        values = read_yaml(path)
    except InputError as error:
        raise InputError(f"configuration file {brief(str(path))}: {error}") from None
    for text in _texts(values):
        if text in ORDERS or "${" in text:
            accepted = f"no {brief(text)} in it"
            raise InputError(rejection("configuration file", str(path), accepted))
    return values


def _texts(value: Any) -> Iterator[str]:
    """Every name, and every text among the values."""
    if isinstance(value, dict):
        for name, entry in value.items():
            yield str(name)
            yield from _texts(entry)
    elif isinstance(value, list):
        for entry in value:
            yield from _texts(entry)
    elif isinstance(value, str):
        yield value
