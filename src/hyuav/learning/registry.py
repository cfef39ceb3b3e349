"""The algorithms by name, and how a user's own join them."""

import copyreg
import re
from typing import Any

from hyuav._support.errors import InputError, InputTypeError, rejection
from hyuav._support.registry import Registry
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.robust import RobustDDPG, RobustSAC, RobustTD3
from hyuav.learning.maddpg import MADDPG
from hyuav.learning.sac import SAC
from hyuav.learning.td3 import TD3

PEER = "stable_baselines3"
"""In a comparison, that library's DDPG."""

GENERALIST = "generalist"
"""In a comparison, the policy for every layout as it is shipped."""

BESIDE = (PEER, GENERALIST)
"""What is compared and no algorithm of this registry; no algorithm may have such a name."""


def _accept(name: str, algorithm: Any, reference: str | None) -> type[AlgorithmParameters]:
    """Accept a class of parameters that can be created without arguments."""
    if reference is None:
        _require_name(name)
    try:
        acceptable = isinstance(algorithm(), AlgorithmParameters)
    except TypeError:
        acceptable = False
    if not acceptable:
        accepted = "a subclass of AlgorithmParameters with build() and a default for each field"
        raise InputTypeError(rejection(name, algorithm, accepted))
    if reference is not None:
        # Another process, to which parameters are sent, has to run the file before it makes them.
        copyreg.pickle(algorithm, lambda own: (_received, (reference, own.to_dict())))
    found: type[AlgorithmParameters] = algorithm
    return found


def _received(reference: str, values: dict[str, Any]) -> AlgorithmParameters:
    return ALGORITHMS[ALGORITHMS.run_own(reference)].from_dict(values)


ALGORITHMS: Registry[type[AlgorithmParameters]] = Registry(
    {
        "ddpg": DDPG,
        "td3": TD3,
        "sac": SAC,
        "maddpg": MADDPG,
        "ddpg_robust": RobustDDPG,
        "td3_robust": RobustTD3,
        "sac_robust": RobustSAC,
    },
    field="algorithm",
    kind="an algorithm",
    group="hyuav.algorithms",
    accept=_accept,
)
"""Those of this library, and after them those that were registered or named."""

BUILT_IN = tuple(ALGORITHMS)


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
    ALGORITHMS[name] = _accept(name, algorithm, None)


def _require_name(name: Any) -> None:
    written = isinstance(name, str) and re.fullmatch(r"[a-z][a-z0-9_]*", name)
    # ..._robust stands for variants of a plain one
    if not written or name in (*BUILT_IN, *BESIDE) or name.endswith("_robust"):
        accepted = "lower-case letters, digits and underscores, and a name that is not taken"
        raise InputError(rejection("algorithm", name, accepted))
