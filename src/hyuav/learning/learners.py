"""Learners, and what a person may give for those of a training."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from hyuav._support.errors import InputTypeError, rejection
from hyuav._support.parameters import Count, CountOrZero, Parameters, checked, parameter, plain
from hyuav.physics.modes import ModeRuleName
from hyuav.physics.scenario import Scenario

_NumLearners = Annotated[int, Field(ge=1, le=10**6)]


@dataclass(frozen=True)
class Learner(Parameters):
    """What distinguishes one learner from another.

    All its random numbers come from its seed: initial weights, exploration, fading, sampling. So
    it learns the same alone and among others, and learners of equal seeds that differ in scheme
    or horizon begin with the same weights and meet the same fading.
    """

    scheme: ModeRuleName = parameter("hybrid")
    seed: CountOrZero = parameter(0)
    num_slots: Count | None = parameter(None, symbol="T")
    """The horizon; the scenario's where it is None."""

    def horizon(self, scenario: Scenario) -> int:
        """T: its own, or else the scenario's."""
        return self.num_slots or scenario.num_slots


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
