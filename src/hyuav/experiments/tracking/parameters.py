"""What a logger is told of a run, checked before anything is computed."""

import os
import re
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field
from pydantic.dataclasses import dataclass

from hyuav._support.machine import require_installed
from hyuav._support.parameters import OneOf, Parameters, Text, ZeroOrMore, parameter

MODES = ("offline", "online", "disabled")
LONGEST, LONGEST_TAG = 128, 64
"""Characters, as W&B accepts them."""

RESERVED = "/\\#?%:"


NAME = f"text of at most {LONGEST} characters"

Label = Annotated[Text, Field(max_length=LONGEST, description=NAME)]
Owner = Annotated[
    Label,
    Field(
        pattern=f"^[^{re.escape(RESERVED)}]*$",
        description=f"{NAME} without {' '.join(RESERVED)}",
    ),
]
Identifier = Annotated[
    Label,
    Field(
        pattern=f"^[^{re.escape(RESERVED)};,']*$",
        description=f"{NAME} without {' '.join(RESERVED)} ; , '",
    ),
]
"""What a W&B run can be known by."""
Tag = Annotated[
    Text, Field(max_length=LONGEST_TAG, description=f"text of at most {LONGEST_TAG} characters")
]

WANDB, TENSORBOARD = "wandb", "tensorboard"
AS_TRAINED = "as_trained"

_OTHER_WORDS = {"dryrun": "offline", "run": "online"}
"""Under which WANDB_MODE knows its modes too."""


def _mode(default: str) -> Any:
    def find() -> str:
        word = os.environ.get("WANDB_MODE") or default
        return _OTHER_WORDS.get(word, word)

    return parameter(factory=find)


def _from_environment(variable: str, default: str | None = None) -> Any:
    return parameter(factory=lambda: os.environ.get(variable) or default)


def _tags() -> tuple[str, ...]:
    return tuple(filter(None, os.environ.get("WANDB_TAGS", "").split(",")))


@dataclass(frozen=True)
class LoggerParameters(Parameters):
    """Where the metrics go besides the run directory; what is None is chosen for the user.

    What is not given is what W&B's variables of the environment say, such as ``WANDB_MODE``.

    Raises:
        InputError: the library is not installed.
    """

    library: Annotated[str, OneOf(WANDB, TENSORBOARD)] = parameter(WANDB)
    mode: Annotated[str, OneOf(*MODES)] = _mode("offline")
    """Of W&B; "disabled" for no library."""
    project: Owner = _from_environment("WANDB_PROJECT", "hyuav")
    entity: Owner | None = _from_environment("WANDB_ENTITY")
    """The user or team; None for that of the account."""
    group: Label | None = _from_environment("WANDB_RUN_GROUP")
    job_type: Label | None = _from_environment("WANDB_JOB_TYPE")
    """"train", "evaluate" or "comparison" where it is None."""
    name: Label | None = _from_environment("WANDB_NAME")
    """The directory's where it is None."""
    tags: ZeroOrMore[Tag] = parameter(factory=_tags)
    id: Identifier | None = _from_environment("WANDB_RUN_ID")
    """Of the run, which is continued if there is one."""

    def __post_init__(self) -> None:
        if self.library == TENSORBOARD and self.mode != "disabled":
            require_installed([TENSORBOARD], TENSORBOARD)


@dataclass(frozen=True)
class EvaluationLoggerParameters(LoggerParameters):
    """The same for an evaluation, which by default is logged where the training was."""

    mode: Annotated[str, OneOf(AS_TRAINED, *MODES)] = _mode(AS_TRAINED)


def loggers(default: str) -> Mapping[str, dict[str, Any]]:
    """The members of the group ``logger``, unchecked: a refusal waits for the one that is chosen.

    Args:
        default: the member that a recipe chooses where none is asked for. "as_trained" is offered
            only there.
    """
    own = LoggerParameters.defaults()
    members = {
        WANDB: own,
        TENSORBOARD: {**own, "library": TENSORBOARD, "mode": "offline"},
        "none": {**own, "mode": "disabled"},
    }
    if default == AS_TRAINED:
        members[AS_TRAINED] = EvaluationLoggerParameters.defaults()
    return members
