"""What Weights & Biases is told of a run, checked before anything is computed."""

from dataclasses import dataclass
from typing import Any

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import (
    Converter,
    Parameters,
    choice,
    one_or_more,
    optional,
    parameter,
    text,
)

MODES = ("offline", "online", "disabled")
LONGEST, LONGEST_TAG = 128, 64
"""Characters, as W&B accepts them."""

RESERVED = "/\\#?%:"


def _label(longest: int, reserved: str = "") -> Converter:
    """Accept text of limited length without some characters."""
    accepted = f"text of at most {longest} characters"
    if reserved:
        accepted += f" without {' '.join(reserved)}"

    def convert(name: str, value: Any) -> str:
        label = text(name, value)
        if len(label) > longest or any(character in label for character in reserved):
            raise InputError(rejection(name, value, accepted))
        return label

    return convert


identifier = _label(LONGEST, f"{RESERVED};,'")
"""Accept what a W&B run can be known by."""

_tags = one_or_more(_label(LONGEST_TAG), "a list of tags")


def _any_tags(name: str, value: Any) -> Any:
    return () if value in ([], ()) else _tags(name, value)


@dataclass(frozen=True)
class LoggerParameters(Parameters):
    """Where the metrics go besides the run directory; what is None is chosen for the user."""

    mode: str = parameter(choice(*MODES), "offline")
    project: str = parameter(_label(LONGEST, RESERVED), "hyuav")
    entity: str | None = parameter(optional(_label(LONGEST, RESERVED)), None)
    """The user or team; None for that of the account."""
    group: str | None = parameter(optional(_label(LONGEST)), None)
    job_type: str | None = parameter(optional(_label(LONGEST)), None)
    """"train", "evaluate" or "comparison" where it is None."""
    name: str | None = parameter(optional(_label(LONGEST)), None)
    """The directory's where it is None."""
    tags: tuple[str, ...] = parameter(_any_tags, ())
    id: str | None = parameter(optional(identifier), None)
    """Of the run, which is continued if there is one."""


AS_TRAINED = "as_trained"


@dataclass(frozen=True)
class EvaluationLoggerParameters(LoggerParameters):
    """The same for an evaluation, which by default is logged where the training was."""

    mode: str = parameter(choice(AS_TRAINED, *MODES), AS_TRAINED)
