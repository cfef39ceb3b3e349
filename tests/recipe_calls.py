"""What tests of recipes share: the types of their fixtures, and options for the least of work."""

import sys
from collections.abc import Callable

from hydra.core.config_store import ConfigStore

from hyuav.envs.rewards import REWARDS
from hyuav.learning.registry import ALGORITHMS

Call = Callable[..., None]
"""Runs the recipe of a name with arguments, in the test's directory."""

Refusal = Callable[..., str]
"""Runs a recipe that refuses its arguments, and gives the line that says why."""

TINY_TRAINING = (
    "training.num_episodes=4",
    "training.batch_size=8",
    "training.evaluation_every=2",
    "training.evaluation_episodes=3",
)

TINY = (*TINY_TRAINING, "algorithm.hidden_sizes=[8]", "logger.mode=disabled")
"""Of one algorithm, logged nowhere."""

SHORT = (*TINY, "training.compile=never", "scenario.num_slots=10")
"""The training with which most tests begin."""

FEW = ("evaluation.episodes=4", "evaluation.resolution=10")
"""An evaluation as small as that."""

TINY_COMPARISON = (
    *TINY_TRAINING,
    *("training.compile=never", "evaluation.episodes=4", "evaluation.resolution=10"),
    *("num_slots=8", "learners=2", "workers=1", "output=here"),
)


def forget_own() -> None:
    """Let nothing be chosen any longer that a test named as ``FILE.py:NAME``."""
    for registry in (ALGORITHMS, REWARDS):
        for name in [name for name in registry if ".py:" in name]:
            del registry[name]
    for module in [name for name in sys.modules if name.startswith("hyuav_own_")]:
        del sys.modules[module]
    offered = {f"{name}.yaml" for name in ALGORITHMS}
    groups = ConfigStore.instance().repo.get("algorithm", {})
    for name in groups.keys() - offered:
        del groups[name]
