"""The algorithms by name, and how a user's own join them."""

import copyreg
import importlib.util
import re
import sys
import traceback
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from hyuav._support.errors import InputError, InputTypeError, one_line, rejection, require_choice
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.robust import RobustDDPG, RobustSAC, RobustTD3
from hyuav.learning.sac import SAC
from hyuav.learning.td3 import TD3

INSTALLED = "hyuav.algorithms"
"""Group of the entry points by which installed packages offer algorithms."""

ALGORITHMS: dict[str, type[AlgorithmParameters]] = {
    "ddpg": DDPG,
    "td3": TD3,
    "sac": SAC,
    "ddpg_robust": RobustDDPG,
    "td3_robust": RobustTD3,
    "sac_robust": RobustSAC,
}
"""Those of this library, and after them those that were registered or named."""

BUILT_IN = tuple(ALGORITHMS)

PEER = "stable_baselines3"
"""In a comparison, that library's DDPG; no algorithm may have its name."""


def register(name: str, algorithm: type[AlgorithmParameters]) -> None:
    """Let a name choose an algorithm, on the command line and in a run's configuration.

    It is for programs of one's own. The recipes are given a file and a class in it, or find the
    entry points of installed packages.

    Args:
        name: of lower-case letters, digits and underscores. It replaces an earlier one of the
            user's own.
        algorithm: a frozen dataclass of parameters, each with a default.

    Raises:
        InputError: the name cannot be used.
        InputTypeError: the class cannot be created without arguments, or is of another kind.

    Example:
        >>> register("ddpg_relu", ReluDDPG)
    """
    written = isinstance(name, str) and re.fullmatch(r"[a-z][a-z0-9_]*", name)
    # ..._robust stands for variants of a plain one
    if not written or name in (*BUILT_IN, PEER) or name.endswith("_robust"):
        accepted = "lower-case letters, digits and underscores, and a name that is not taken"
        raise InputError(rejection("algorithm", name, accepted))
    _require_algorithm(name, algorithm)
    ALGORITHMS[name] = algorithm


def _require_algorithm(name: str, algorithm: Any) -> None:
    """Accept a class of parameters that can be created without arguments."""
    try:
        acceptable = isinstance(algorithm(), AlgorithmParameters)
    except TypeError:
        acceptable = False
    if not acceptable:
        accepted = "a subclass of AlgorithmParameters with build() and a default for each field"
        raise InputTypeError(rejection(name, algorithm, accepted))


def find(name: Any) -> type[AlgorithmParameters]:
    """The algorithm of a name, which may be that of an installed package's entry point.

    No file is run: one of ``FILE.py:CLASS`` is found only after :func:`run_own` was given it.

    Raises:
        InputError: there is none of that name, or it cannot be loaded.
    """
    if isinstance(name, str) and name not in ALGORITHMS:
        for entry in entry_points(group=INSTALLED, name=name):
            try:
                register(name, entry.load())
            except Exception as error:  # whichever the package raises
                accepted = f"a package that loads ({one_line(f'{type(error).__name__}: {error}')})"
                raise InputError(rejection("algorithm", name, accepted)) from error
        if is_reference(name):
            accepted = f"an algorithm of a file that you name: algorithm=DIRECTORY/{name}"
            raise InputError(rejection("algorithm", name, accepted))
    require_choice("algorithm", name, names())
    return ALGORITHMS[name]


def names() -> list[str]:
    """Of all algorithms that :func:`find` finds."""
    return list(dict.fromkeys([*ALGORITHMS, *entry_points(group=INSTALLED).names]))


def file_name(name: str) -> str:
    """An algorithm's name as directories bear it."""
    return name.replace(".py:", "_")


def is_reference(name: str) -> bool:
    """Whether a name tells a class of a Python file."""
    return re.fullmatch(r".*\.py:\w+", name, re.DOTALL) is not None


def run_own(reference: str) -> str:
    """Run a Python file, and let the algorithm that a class in it is be chosen by a name.

    Args:
        reference: of the class, ``FILE.py:CLASS``.

    Returns:
        the name: the reference without directories, as a run's configuration keeps it.

    Raises:
        InputError: there is no such file or class, or it fails; its error is the cause.
    """
    path, _, kind = reference.rpartition(":")
    file = Path(path).absolute()
    module = sys.modules.get(f"hyuav_own_{file.stem}") or _run(path)
    if module.__file__ != str(file):
        accepted = f"files of different names, but there is {module.__file__} too"
        raise InputError(rejection("algorithm", reference, accepted))
    algorithm: Any = getattr(module, kind, None)
    _require_algorithm(reference, algorithm)
    name = f"{file.name}:{kind}"
    ALGORITHMS[name] = algorithm
    # Another process, to which parameters are sent, has to run the file before it can make them.
    copyreg.pickle(algorithm, lambda own: (_received, (f"{file}:{kind}", own.to_dict())))
    return name


def _received(reference: str, values: dict[str, Any]) -> AlgorithmParameters:
    return ALGORITHMS[run_own(reference)].from_dict(values)


def _run(path: str) -> ModuleType:
    file = Path(path).absolute()
    name = f"hyuav_own_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None or not file.is_file() or not file.stem.isidentifier():
        raise InputError(rejection("algorithm", path, "a Python file"))
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where dataclasses and pickle look for it
    try:
        spec.loader.exec_module(module)
    except BaseException as error:  # whichever the file raises
        del sys.modules[name]
        accepted = f"a Python file that runs ({_failure(error, file)})"
        raise InputError(rejection("algorithm", path, accepted)) from error
    return module


def _failure(error: BaseException, file: Path) -> str:
    """What went wrong, and in which file and line; the path may be too long to be shown whole."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(file)]
    line = f", line {lines[-1]}" if lines else ""
    return one_line(f"{file.name}{line}: {type(error).__name__}: {error}")
