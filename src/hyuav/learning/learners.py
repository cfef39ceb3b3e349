"""What a person may give for the learners of a training."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from hyuav._support.errors import InputTypeError, rejection
from hyuav._support.parameters import checked, plain
from hyuav.learning.train import Learner

_NumLearners = Annotated[int, Field(ge=1, le=10**6)]


def as_learners(learners: int | Learner | Sequence[int | Learner]) -> tuple[Learner, ...]:
    """One learner or more as they are, or of these seeds, or so many with seeds from 0 on.

    Raises:
        InputError: there is none, or a seed is below 0.
        InputTypeError: it is something else.
    """
    given = plain(learners)
    if type(given) is int:
        given = tuple(range(checked(_NumLearners, "learners", given)))
    several = given if isinstance(given, tuple) else (given,)
    made = tuple(Learner(seed=own) if type(own) is int else own for own in several)
    if not made or not all(isinstance(learner, Learner) for learner in made):
        accepted = "a list of at least one Learner or seed, or a number of learners"
        raise InputTypeError(rejection("learners", learners, accepted))
    return made
