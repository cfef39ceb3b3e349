"""What guides the learners of the robust variants, and every number that decides how."""

from dataclasses import replace
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import (
    Count,
    CountOrZero,
    Fraction,
    Parameters,
    PositiveNumber,
    parameter,
)
from hyuav.learning.algorithm import Sizes

OFF: dict[str, dict[str, bool | int | float]] = {
    "warm_up_episodes": {"warm_up_episodes": 0},
    "repeat_every": {"repeat_every": 0},
    "control_variate": {"control_variate": False, "imagined_flights": 0},
    "imagined_flights": {"imagined_flights": 0},
    "imitation_weight": {"imitation_weight": 0.0},
}
"""By piece that a guide can do without, the parameters that leave it out, and with it what
depends on it."""


@dataclass(frozen=True)
class Guide(Parameters):
    """A guide's pieces and their numbers; what each piece is for is told in docs/results.md."""

    warm_up_episodes: CountOrZero = parameter(100)
    """Flown to places all over the map; see :class:`hyuav.learning.guide.warm_up.WarmUp`."""
    warm_up_noise: Fraction = parameter(0.1, unit="v_max")
    """Standard deviation of the noise on those flights."""
    destination_spread: Annotated[float, Field(ge=1.0, le=10.0)] = parameter(1.25)
    """Where their destinations, and those of imagined flights, are drawn, in units of the map;
    those beyond it are brought to its edge."""
    update_every: Count = parameter(4, unit="episode")
    """How often all that is remembered is gone through, to update the reward model and to draw
    the flight that it may hold best."""
    repeat_every: CountOrZero = parameter(4, unit="episode")
    """After the warm-up, every n-th episode takes the actions of the best flight so far, or of one
    that may be better; 0 for never, otherwise a multiple of ``update_every``: that flight is drawn
    in the episode before. See :class:`hyuav.learning.guide.planner.Planner`."""
    control_variate: bool = parameter(True)
    """Take off each reward what its slot's fading brought; see
    :class:`hyuav.learning.guide.control_variate.ControlVariate`."""
    variate_hidden_sizes: Sizes = parameter((64, 64))
    """Of the control variate's network; the last are features of the reward model too."""
    variate_learning_rate: Fraction = parameter(1e-3)
    imagined_flights: Annotated[int, Field(ge=0, le=100_000)] = parameter(64)
    """After each episode from the end of the warm-up on: how many straight flights are judged, and
    as many variations of the best; see :class:`hyuav.learning.guide.proposals.TrajectoryProposals`.
    The reward model that judges them needs the control variate."""
    power_levels: Count = parameter(6)
    """Where power is controlled: how many levels, evenly apart in dB and others in every episode,
    are tried in each slot of an imagined flight, beside its own."""
    displacement_range: Annotated[float, Field(ge=1.0, le=1e6)] = parameter(40.0)
    """Ratio of the largest typical displacement of a variation, which is what is flown in a slot,
    to the smallest."""
    posterior_scale: Annotated[float, Field(ge=0.0, le=1e6)] = parameter(5.0)
    """By which the reward model's posterior is widened: it does not know what its features cannot
    show."""
    least_noise: PositiveNumber = parameter(1e-6)
    """Of the features' mean square sum, what the noise of rewards counts at least, so that the
    reward model's equations can be solved where they are almost without noise."""
    most_ue_features: CountOrZero = parameter(50)
    """Number of UEs, times that of helpers, up to which each has features of its own in the reward
    model; their products are summed over the whole memory."""
    imitation_weight: Annotated[float, Field(ge=0.0, le=1e6)] = parameter(0.1)
    """How strongly the actor is drawn to a demonstrated action that is worth more than what it
    does; with any weight, the critics' target counts whichever is worth more. See
    :class:`hyuav.learning.guide.imitation.Imitation`."""
    q_margin: Annotated[float, Field(ge=0.0, le=1e6)] = parameter(0.025)
    """Scaled reward by which a demonstrated action must be worth more; where hovering just so is
    all that matters, the best actions are near, and gradients find them."""
    return_margin: Fraction = parameter(0.005)
    """Share by which the best flight must be worth more than an actor's own to be joined
    everywhere."""

    def __post_init__(self) -> None:
        if self.repeat_every % self.update_every:
            accepted = f"a multiple of update_every = {self.update_every}, or 0"
            raise InputError(rejection("repeat_every", self.repeat_every, accepted))
        if self.imagined_flights and not (self.control_variate and self.keeps_flights):
            accepted = "0 without control_variate, or without repeat_every and imitation_weight"
            raise InputError(rejection("imagined_flights", self.imagined_flights, accepted))

    @property
    def keeps_flights(self) -> bool:
        """Whether best flights are of use."""
        return self.repeat_every > 0 or self.imitation_weight > 0

    def repeats(self, episode: int) -> bool:
        """Whether an episode, from 1, takes the actions of the planned flight."""
        every = self.repeat_every
        return every > 0 and episode % every == 0 and episode > self.warm_up_episodes

    def updates(self, episode: int) -> bool:
        """Whether a flight is drawn at the end of an episode, for the next one to take."""
        return (episode + 1) % self.update_every == 0

    def without(self, piece: str) -> "Guide":
        """The same guide without a piece of :data:`OFF`."""
        return replace(self, **OFF[piece])  # type: ignore[arg-type]
