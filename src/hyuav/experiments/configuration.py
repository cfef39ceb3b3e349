"""Hydra for the recipes: typed defaults by name, and one line for every mistake."""

import contextlib
import dataclasses
import os
import shlex
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import hydra
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from hyuav._support.errors import Halted, InputError, Interrupted, cause, harmless, one_line
from hyuav._support.interruption import interrupted_by_sigterm
from hyuav._support.parameters import Parameters, mapping
from hyuav._support.program import loaded, program
from hyuav._support.registry import file_name
from hyuav.experiments.command_line import remember
from hyuav.experiments.configuration_files import read_files_as_data
from hyuav.experiments.elsewhere import AS_TRAINED, as_trained
from hyuav.experiments.mistakes import Vocabulary, explain, members_of
from hyuav.experiments.own_code import Named, run_again, run_named, with_own
from hyuav.experiments.scenarios import NAMES, offered
from hyuav.experiments.tracking import LoggerParameters, loggers
from hyuav.experiments.usage import usage
from hyuav.learning.registry import ALGORITHMS
from hyuav.physics.scenario import PRESETS

NOW = "${now:%Y-%m-%d_%H-%M-%S}"
"""In the pattern of a run's directory, when the command was called."""

LOGGER = "logger"
"""The group whose members have no name of their own: its ``name`` is that of the run."""

Config = dict[str, Any]
"""A composed configuration in plain values."""

Record = TypeVar("Record", bound=Parameters)


def register(groups: Mapping[str, str]) -> None:
    """Offer scenarios, algorithms and loggers as groups of these names.

    Args:
        groups: that are wanted, and the member chosen by default. Where one is not, its name is
            free for a plain entry.
    """
    store = ConfigStore.instance()
    members: dict[str, dict[str, Config]] = {
        "scenario": {name: {"name": name, **offered(name)} for name in NAMES},
        "algorithm": {
            file_name(name): {"name": name, **kind().to_dict()} for name, kind in ALGORITHMS.items()
        },
        LOGGER: {**loggers(groups.get(LOGGER, ""))},
    }
    if groups.get("scenario") == AS_TRAINED:
        members["scenario"][AS_TRAINED] = as_trained()
    for group, known in members.items():
        store.repo.pop(group, None)  # with the files of an earlier call
        for member, node in known.items() if group in groups else ():
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
    vocabulary = partial(Vocabulary, node, groups)
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
                function(_plain(config, names, groups, sections, vocabulary), directory)

        # Or Hydra would take this package's folders for groups: hyuav/viz for ``viz=...``.
        run.__module__ = "__main__"

        def command() -> None:
            nonlocal composed, own
            composed = False
            os.environ["HYDRA_FULL_ERROR"] = "1"  # or Hydra would exit before the lines below
            register(groups)
            if not {"-h", "--help"}.isdisjoint(sys.argv[1:]):
                offered = {group: (member, members_of(group)) for group, member in groups.items()}
                logged = {LOGGER: LoggerParameters.defaults()} if LOGGER in groups else {}
                fields, names_of = {**node, **logged}, [*sections, *logged]
                loaded()
                told = usage(name, function.__globals__["__doc__"], fields, offered, names_of)
                sys.stdout.write(f"{told}\n")  # at once, as what is piped to may end early
                return
            with _ending_in_one_line(vocabulary, lambda: composed):
                loaded()  # from here on an interruption is answered
                remember()
                if own := run_named(chosen="algorithm" in groups):
                    register(groups)
                read_files_as_data(groups, _completed)
                vocabulary().refuse(sys.argv[1:])
                hydra.main(version_base=None, config_path=None, config_name=name)(run)()

        return command

    return decorate


@contextmanager
def _job(hint: str) -> Iterator[Path]:
    """Do one job in its directory; a refusal or a halt of the only one ends the command.

    Args:
        hint: on how to go on after a halt.
    """
    runtime = mapping("runtime", OmegaConf.to_container(HydraConfig.get().runtime))  # with any $
    directory = Path(runtime["output_dir"])
    try:
        with _halting(hint):
            os.chdir(runtime["cwd"])  # whatever hydra.job.chdir says: paths keep their meaning
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
def _ending_in_one_line(
    vocabulary: Callable[[], Vocabulary], composed: Callable[[], bool]
) -> Iterator[None]:
    """End the command with one line on what the user has to change or to know.

    Args:
        vocabulary: of the recipe, as far as it is known.
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
        _end(explain(error, vocabulary()), 2)
    except KeyboardInterrupt as error:
        print(harmless(str(error)) or "interrupted", file=sys.stderr)
        sys.exit(128 + (error.signal if isinstance(error, Interrupted) else signal.SIGINT))
    except Halted as error:
        _end(str(error), 1)


def _completed(group: str, member: str, values: Config) -> Config:
    """A file's values, with the defaults of what it leaves out, so that these can be set too.

    Args:
        group: of the file.
        member: what the file is called in it.
        values: in the file.

    Raises:
        InputError: the file is of an unknown algorithm.
    """
    if group == "algorithm":
        defaults = ALGORITHMS.find(values.get("name", member))().to_dict()
    elif group == LOGGER:
        defaults = LoggerParameters.defaults()
    else:
        preset = str(values.get("name", member))
        base = preset if preset in PRESETS else NAMES[0]
        defaults = offered(str(values.get("layout", base)))
        defaults.pop("ue_positions", None)
    completed = {**defaults, **values}
    for name, own in defaults.items():
        if isinstance(own, dict) and isinstance(values.get(name), dict):
            completed[name] = {**own, **values[name]}
    return completed


def _plain(
    config: DictConfig,
    names: Iterable[str],
    groups: Iterable[str],
    sections: Iterable[str],
    vocabulary: Callable[[], Vocabulary],
) -> Config:
    """The configuration in plain values, with exactly the entries that are named.

    Raises:
        InputError: another entry, a missing one, or a section without names.
    """
    try:
        plain = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as error:
        raise InputError(explain(error, vocabulary())) from None
    values = mapping("configuration", plain)
    for name in values:
        if name not in names:
            raise vocabulary().unknown(name)
    for name in names:
        if name not in values:
            raise InputError(f"configuration: {name} is missing")
    for name in sections:
        values[name] = mapping(name, values[name])
    for name in groups:  # a user's own file need not repeat its name
        own_name = {} if name == LOGGER else {"name": HydraConfig.get().runtime.choices[name]}
        values[name] = {**own_name, **mapping(name, values[name])}
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


def section(config: Config, parameters: type[Record]) -> Record:
    """Read a record from the entries of a configuration that bear its fields' names.

    Raises:
        InputError: an unacceptable value.
    """
    names = [field.name for field in dataclasses.fields(parameters)]
    return parameters.from_dict({name: config[name] for name in names})


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
