"""What Weights & Biases is told of a run, checked before anything is computed."""

import re
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

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


@dataclass(frozen=True)
class LoggerParameters(Parameters):
    """Where the metrics go besides the run directory; what is None is chosen for the user."""

    mode: Annotated[str, OneOf(*MODES)] = parameter("offline")
    project: Owner = parameter("hyuav")
    entity: Owner | None = parameter(None)
    """The user or team; None for that of the account."""
    group: Label | None = parameter(None)
    job_type: Label | None = parameter(None)
    """"train", "evaluate" or "comparison" where it is None."""
    name: Label | None = parameter(None)
    """The directory's where it is None."""
    tags: ZeroOrMore[Tag] = parameter(())
    id: Identifier | None = parameter(None)
    """Of the run, which is continued if there is one."""


AS_TRAINED = "as_trained"


@dataclass(frozen=True)
class EvaluationLoggerParameters(LoggerParameters):
    """The same for an evaluation, which by default is logged where the training was."""

    mode: Annotated[str, OneOf(AS_TRAINED, *MODES)] = parameter(AS_TRAINED)
