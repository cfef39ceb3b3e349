"""Reinforcement learning for UAV-enabled secure offloading with a hybrid relay and jammer.

The stub beside this file, ``__init__.pyi``, lists the public names. Each is imported where it is
first used, so that ``import hyuav`` takes no longer than Gymnasium, at which it registers
``hyuav/SecureOffloading-v0``.
"""

import ast
import importlib
from pathlib import Path

import gymnasium

__version__ = "0.2.0"

_ORIGINS: dict[str, tuple[str, str]] = {
    str(alias.asname): (str(line.module), alias.name)
    for line in ast.parse(Path(__file__).with_suffix(".pyi").read_text("utf-8")).body
    if isinstance(line, ast.ImportFrom)
    for alias in line.names
}
"""The module in which each public name is defined, and its name there."""

__all__ = list(_ORIGINS)


def __getattr__(name: str) -> object:
    if name not in _ORIGINS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, own = _ORIGINS[name]
    value = globals()[name] = getattr(importlib.import_module(module), own)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


gymnasium.register(
    "hyuav/SecureOffloading-v0",
    entry_point="hyuav.envs.gymnasium:SecureOffloadingGymEnv",
    vector_entry_point="hyuav.envs.gymnasium:SecureOffloadingVectorEnv",
)
