"""The call that goes on with a job, as it was typed."""

import sys
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode

from hyuav.experiments.configuration_files import choosing_files
from hyuav.experiments.own_code import as_named
from hyuav.experiments.quoting import override

_typed: list[str] = []
"""The arguments of this call, before Hydra's own names take the place of files."""


def remember() -> None:
    """Keep the arguments of this call, so that it can be told again."""
    _typed[:] = sys.argv[1:]


def same_call(name: str, path: Path) -> list[str]:
    """The overrides of this call, with an entry set to a path.

    Args:
        name: of the entry.
        path: as :func:`.quoting.override` takes it.
    """
    config = HydraConfig.get()
    words = list(_typed)
    if config.mode is RunMode.MULTIRUN:  # of one job of several, which goes on by itself
        words = choosing_files([as_named(each) for each in config.overrides.task])
    return [*(each for each in words if not each.startswith(f"{name}=")), override(name, path)]
