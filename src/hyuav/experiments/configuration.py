"""Hydra for the recipes: typed defaults by name, and one line for every mistake."""

import contextlib
import dataclasses
import logging
import os
import re
import shlex
import signal
import sys
from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import hydra
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.errors import ConfigCompositionException, HydraException, MissingConfigException
from hydra.types import RunMode
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import MissingMandatoryValue, OmegaConfBaseException

from hyuav._support.errors import (
    Halted,
    InputError,
    Interrupted,
    brief,
    cause,
    did_you_mean,
    harmless,
    one_line,
    rejection,
    require_choice,
)
from hyuav._support.interruption import interrupted_by_sigterm
from hyuav._support.parameters import Parameters, mapping, refuse_unknown, unknown_field
from hyuav._support.registry import file_name
from hyuav._support.start import loaded, program
from hyuav.experiments.configuration_files import read_files_as_data
from hyuav.experiments.own_code import Named, run_again, run_named, with_own
from hyuav.experiments.usage import usage
from hyuav.learning.registry import ALGORITHMS
from hyuav.physics.scenario import PRESETS, Scenario

NOW = "${now:%Y-%m-%d_%H-%M-%S}"
"""In the pattern of a run's directory, when the command was called."""

Config = dict[str, Any]
"""A composed configuration in plain values."""

Record = TypeVar("Record", bound=Parameters)


def register(groups: Iterable[str]) -> None:
    """Offer the presets and the algorithms as the groups ``scenario`` and ``algorithm``.

    Args:
        groups: that are wanted. Where one is not, its name is free for a plain entry.
    """
    store = ConfigStore.instance()
    members: dict[str, dict[str, tuple[str, Parameters]]] = {
        "scenario": {name: (name, Scenario.preset(name)) for name in PRESETS},
        "algorithm": {file_name(name): (name, kind()) for name, kind in ALGORITHMS.items()},
    }
    for group, known in members.items():
        store.repo.pop(group, None)  # with the files of an earlier call
        for member, (name, parameters) in known.items() if group in groups else ():
            node = {"name": name, **parameters.to_dict()}
            store.store(group=group, name=member, node=node)


def recipe(
    name: str,
    options: type[Parameters],
    *,
    groups: Mapping[str, str],
    sections: Mapping[str, Callable[[], Parameters]],
    run_directory: str,
) -> Callable[[Callable[[Config, Path], None]], Callable[[], None]]:
    """Turn a function into a command with Hydra's overrides.

    The function is given the configuration in plain values, from which :func:`section` reads the
    typed records, and the run's directory. Mistakes of the user end the command with one line
    and exit status 2, a machine that fails, such as by a full disk, with one line and 1.

    Args:
        name: of the recipe.
        options: the typed defaults at the top of the configuration.
        groups: Hydra's groups and the member chosen by default.
        sections: what makes the typed defaults of the configuration's other sections.
        run_directory: pattern of the directory in which a run keeps its files. Those of a multirun
            stand together in one directory, by their numbers.
    """
    node = _node(options, groups, sections, run_directory)
    names = [*options().to_dict(), *sections, *groups]
    ConfigStore.instance().store(name=name, node=node)

    def decorate(function: Callable[[Config, Path], None]) -> Callable[[], None]:
        composed = False
        own: list[Named] = []

        def run(config: DictConfig) -> None:
            nonlocal composed
            composed = True
            run_again(own)  # a launcher's worker has not run it yet
            hint = "" if NOW in run_directory else ", and the same command goes on"
            with _job(hint) as directory:
                function(_plain(config, names, groups, sections), directory)

        # Or Hydra would take this package's folders for groups: hyuav/viz for ``viz=...``.
        run.__module__ = "__main__"

        def command() -> None:
            nonlocal composed, own
            composed = False
            os.environ["HYDRA_FULL_ERROR"] = "1"  # or Hydra would exit before the lines below
            logging.getLogger("torchrl").setLevel(logging.WARNING)
            register(groups)
            if not {"-h", "--help"}.isdisjoint(sys.argv[1:]):
                offered = {group: (member, _members(group)) for group, member in groups.items()}
                told = usage(name, function.__globals__["__doc__"], node, offered, sections)
                sys.stdout.write(f"{told}\n")  # at once, as what is piped to may end early
                return
            with _ending_in_one_line(lambda: composed):
                loaded()  # from here on an interruption is answered
                own = run_named(chosen="algorithm" in groups)
                register(groups)
                _refuse_overrides(node, groups)
                read_files_as_data(groups)
                hydra.main(version_base=None, config_path=None, config_name=name)(run)()

        return command

    return decorate


@contextmanager
def _job(hint: str) -> Iterator[Path]:
    """Do one job in its directory; a refusal or a halt of the only one ends the command.

    Args:
        hint: on how to go on after a halt.
    """
    directory = Path(HydraConfig.get().runtime.output_dir)
    try:
        with _halting(hint):
            yield directory
    except (InputError, Halted) as error:
        remove_if_empty(directory)
        if HydraConfig.get().mode is RunMode.MULTIRUN:
            raise  # the other jobs go on, and Hydra says which one it was
        _end(str(error), 1 if isinstance(error, Halted) else 2)  # before Hydra adds lines


def _node(
    options: type[Parameters],
    groups: Mapping[str, str],
    sections: Mapping[str, Callable[[], Parameters]],
    run_directory: str,
) -> dict[str, Any]:
    """The defaults of a recipe's configuration, and how Hydra is to treat them."""
    sweep, _, own = run_directory.partition(f"{NOW}_")
    return {
        **options().to_dict(),
        **{section: parameters().to_dict() for section, parameters in sections.items()},
        "hydra": {
            "run": {"dir": run_directory},
            "sweep": {
                "dir": f"{sweep}{NOW}_sweep" if own else run_directory,
                "subdir": f"${{hydra.job.num}}_{own}" if own else "${hydra.job.num}",
            },
            "output_subdir": None,
        },
        "defaults": [
            *({group: member} for group, member in groups.items()),
            {"override hydra/job_logging": "none"},
            {"override hydra/hydra_logging": "none"},
            "_self_",
        ],
    }


@contextmanager
def _ending_in_one_line(composed: Callable[[], bool]) -> Iterator[None]:
    """End the command with one line on what the user has to change or to know.

    Args:
        composed: whether Hydra has accepted the command line; from then on whatever is raised but
            refusals is a fault of the program, to be seen whole.
    """
    try:
        yield
    except RecursionError:
        if composed():
            raise
        _end("the command line is nested too deep", 2)
    except (HydraException, OmegaConfBaseException, ValueError, OSError) as error:
        if composed() and not isinstance(error, InputError):
            raise
        _end(explain(error), 2)
    except KeyboardInterrupt as error:
        print(harmless(str(error)) or "interrupted", file=sys.stderr)
        sys.exit(128 + (error.signal if isinstance(error, Interrupted) else signal.SIGINT))
    except Halted as error:
        _end(str(error), 1)


def _refuse_overrides(node: Mapping[str, Any], groups: Iterable[str]) -> None:
    """Refuse what Hydra accepts or does not explain.

    Raises:
        InputError: an override of what would lie below a single value or a list; a group without
            a member, or with a list of them; several jobs where there is no directory for each.
    """
    repository = ConfigStore.instance().repo
    members = {group: [each.node for each in repository[group].values()] for group in groups}
    known = {**node, **{group: dict(ChainMap(*nodes)) for group, nodes in members.items()}}
    once = node["hydra"]["run"]["dir"] == "."
    for argument in sys.argv[1:]:
        if once and argument in ("-m", "--multirun"):
            raise InputError(f"{argument}: this recipe does a single job: leave it out")
        name, _, value = argument.partition("=")
        entry = name.lstrip("+~")
        if entry in groups and (name.startswith("~") or value.startswith("[")):
            require_choice(name, value, _members(entry))
        path = entry.split(".")
        below: Any = known
        for depth, key in enumerate(path):
            if not isinstance(below, Mapping):
                whole = ".".join(path[:depth])
                raise InputError(f"{brief(argument)}: {whole} has no fields: set {whole}=...")
            if key not in below:
                break
            below = below[key]


def _members(group: str) -> list[str]:
    """What a group offers, by name."""
    offered = ConfigStore.instance().repo[group]
    return sorted(member.removesuffix(".yaml") for member in offered)


def _plain(
    config: DictConfig, names: Iterable[str], groups: Iterable[str], sections: Iterable[str]
) -> Config:
    """The configuration in plain values, with exactly the entries that are named.

    Raises:
        InputError: another entry, a missing one, or a section without names.
    """
    try:
        plain = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as error:
        raise InputError(explain(error)) from None
    values = mapping("configuration", plain)
    refuse_unknown("configuration", values, names)
    for name in names:
        if name not in values:
            raise InputError(f"configuration: {name} is missing")
    for name in sections:
        values[name] = mapping(name, values[name])
    for name in groups:  # a user's own file need not repeat its name
        member = HydraConfig.get().runtime.choices[name]
        values[name] = {"name": member, **mapping(name, values[name])}
    return values


def remove_if_empty(directory: Path) -> None:
    """Remove a directory that Hydra made and nothing was kept in."""
    if directory.is_dir() and not any(directory.iterdir()) and directory.resolve() != Path.cwd():
        with contextlib.suppress(OSError):  # on a disk that has become read-only
            directory.rmdir()


def given() -> set[str]:
    """The names of the entries that the command line set."""
    overrides = HydraConfig.get().overrides
    both = (*overrides.task, *overrides.hydra)
    return {override.partition("=")[0].lstrip("+~") for override in both}


@contextmanager
def telling_how_to_go_on(
    *overrides: str, possible: Callable[[], bool] = lambda: True
) -> Iterator[None]:
    """Let whoever interrupts what is done inside know the command that goes on with it.

    SIGTERM interrupts it as SIGINT does.

    Args:
        overrides: with which to call the same recipe.
        possible: whether anything has begun with which to go on.

    Raises:
        Interrupted: in place of any other interruption, with the command.
        Halted: with the command where going on is possible; in place of an OSError too.
    """
    hint = f"go on with: {shlex.join([*program(), *with_own(overrides)])}"
    try:
        with interrupted_by_sigterm(), _halting(""):
            yield
    except KeyboardInterrupt as error:
        if not possible():
            raise
        number = error.signal if isinstance(error, Interrupted) else signal.SIGINT
        raise Interrupted(f"{str(error) or 'interrupted'}; {hint}", number) from None
    except Halted as error:
        if not error.resumable or not possible():
            raise
        raise Halted(f"{error}; {hint}") from None


def same_call(name: str, path: Path) -> list[str]:
    """The overrides of this call, with an entry set to a path.

    Args:
        name: of the entry.
        path: as :func:`override` takes it.
    """
    config = HydraConfig.get()
    one_of_several = config.mode is RunMode.MULTIRUN  # which goes on by itself
    given = config.overrides.task if one_of_several else sys.argv[1:]
    others = (each for each in given if not each.startswith(f"{name}="))
    return [*others, override(name, path)]


def override(name: str, path: Path) -> str:
    """What sets an entry to a path on the command line, in quotation marks where it needs them.

    Args:
        name: of the entry.
        path: told from the working directory if it is below.
    """
    absolute = path.absolute()
    below = absolute.is_relative_to(Path.cwd())
    value = str(absolute.relative_to(Path.cwd()) if below else absolute)
    if not re.fullmatch(r"[A-Za-z./_][\w./:+-]*/[\w./:+-]*", value):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        value = f'"{escaped}"'
    return f"{name}={value}"


def section(config: Config, parameters: type[Record]) -> Record:
    """Read a record from the entries of a configuration that bear its fields' names.

    Raises:
        InputError: an unacceptable value.
    """
    names = [field.name for field in dataclasses.fields(parameters)]
    return parameters.from_dict({name: config[name] for name in names})


def explain(error: Exception) -> str:
    """One line that says what was wrong and what is accepted."""
    reason = error.__cause__
    if isinstance(error, MissingConfigException) and error.options is not None:
        group, _, member = str(error.missing_cfg_file).rpartition("/")
        hint = did_you_mean(member, error.options)
        return rejection(group, member, f"one of {', '.join(error.options)}{hint}")
    if isinstance(error, ConfigCompositionException) and isinstance(reason, OmegaConfBaseException):
        known = reason.parent_node
        if reason.full_key is not None and isinstance(known, DictConfig):
            owner, _, key = reason.full_key.rpartition(".")
            if key not in known:
                names = [str(name) for name in known if name != "hydra"]
                return str(unknown_field(owner or "configuration", key, names))
        error = reason
    if isinstance(error, MissingMandatoryValue):
        return rejection(str(error.full_key), MISSING, "a value")
    text = str(error).split("\n    full_key")[0].split("\nSee https")[0]
    return one_line(text)


@contextmanager
def _halting(hint: str) -> Iterator[None]:
    """Halt where the system refuses to read or write, with the file, why, and a hint behind."""
    try:
        yield
    except OSError as error:
        line = one_line(f"halted: {cause(error)}; what was there before is kept")
        raise Halted(f"{line}{hint}") from error


def _end(line: str, status: int) -> NoReturn:
    print(f"error: {harmless(line)}", file=sys.stderr)
    sys.exit(status)
