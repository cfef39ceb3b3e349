"""What tests of recipes share: the types of their fixtures, and options for the least of work."""

from collections.abc import Callable

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

TINY_COMPARISON = (
    *TINY_TRAINING,
    *("training.compile=never", "evaluation.episodes=4", "evaluation.resolution=10"),
    *("num_slots=8", "learners=2", "workers=1", "output=here"),
)
