"""The algorithms by name, and how a user's own join them."""

import importlib.util
import os
import re
import sys
import traceback
from pathlib import Path

from hyuav._support.errors import InputError, InputTypeError, one_line, rejection
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.robust import RobustDDPG, RobustSAC, RobustTD3
from hyuav.learning.sac import SAC
from hyuav.learning.td3 import TD3

OWN_FILES = "HYUAV_ALGORITHMS"
"""Environment variable that names Python files with a user's own algorithms."""

ALGORITHMS: dict[str, type[AlgorithmParameters]] = {
    "ddpg": DDPG,
    "td3": TD3,
    "sac": SAC,
    "ddpg_robust": RobustDDPG,
    "td3_robust": RobustTD3,
    "sac_robust": RobustSAC,
}
"""Those of this library, and after them those that :func:`register` has added."""

BUILT_IN = tuple(ALGORITHMS)

PEER = "stable_baselines3"
"""In a comparison, that library's DDPG; no algorithm may have its name."""


def register(name: str, algorithm: type[AlgorithmParameters]) -> None:
    """Let a name choose an algorithm, on the command line and in a run's configuration.

    The recipes find it in a file that the environment variable ``HYUAV_ALGORITHMS`` names. No
    file of a run names code to be executed.

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
    try:
        acceptable = isinstance(algorithm(), AlgorithmParameters)
    except TypeError:
        acceptable = False
    if not acceptable:
        accepted = "a subclass of AlgorithmParameters with build() and a default for each field"
        raise InputTypeError(rejection(name, algorithm, accepted))
    ALGORITHMS[name] = algorithm


def run_own_files(paths: str) -> None:
    """Run the Python files that register a user's own algorithms.

    Args:
        paths: of the files, joined as in PATH.

    Raises:
        InputError: there is no such file, or it fails; its error is the cause.
    """
    for path in filter(None, paths.split(os.pathsep)):
        spec = importlib.util.spec_from_file_location(f"hyuav_own_{Path(path).stem}", path)
        if spec is None or spec.loader is None or not os.path.isfile(path):  # noqa: PTH113
            raise InputError(rejection(OWN_FILES, path, "a Python file"))
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module  # where dataclasses and pickle look for it
        try:
            spec.loader.exec_module(module)
        except BaseException as error:  # whichever the file raises
            del sys.modules[spec.name]
            accepted = f"a Python file that runs ({_failure(error, path)})"
            raise InputError(rejection(OWN_FILES, path, accepted)) from error


def _failure(error: BaseException, path: str) -> str:
    """What went wrong, and in which file and line; the path may be too long to be shown whole."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(Path(path).absolute())]
    line = f", line {lines[-1]}" if lines else ""
    return one_line(f"{Path(path).name}{line}: {type(error).__name__}: {error}")
