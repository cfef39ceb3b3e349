"""Which flight of each learner is its best, and which it tries next."""

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from torch import Tensor

from hyuav._support.randomness import RowStream, standard_normal
from hyuav.learning.guide.demonstrations import BestFlights
from hyuav.learning.guide.proposals import Imagination
from hyuav.learning.guide.reward_model import Expectation

JUDGED_EVERY = 4
"""Episodes after which a learner goes through all that it remembers."""


class FlightSearch:
    """Keep the flights of which most is to be expected, among those flown and those imagined.

    Args:
        flights: of the N learners, which are kept here.
        expectation: of the same learners.
        imagination: where flights are imagined.
        seeds: of the N learners' random numbers.
    """

    streams: dict[str, RowStream]
    """Of random numbers: ``guesses`` (N, F) and ``variations`` (N, D, 5)."""

    def __init__(
        self,
        flights: BestFlights,
        expectation: Expectation,
        imagination: Imagination | None,
        seeds: Sequence[int],
    ) -> None:
        self._flights, self._expectation = flights, expectation
        self._imagination = imagination
        shapes: dict[str, tuple[int, ...]] = {"guesses": (expectation.size,)}
        if imagination is not None:
            shapes["variations"] = imagination.normals
        device = flights.reward.device
        self.streams = {
            name: RowStream(standard_normal, shape, seeds, name, device)
            for name, shape in shapes.items()
        }

    def go_on(
        self, flown: TensorDictBase, memory: TensorDictBase, episode: int, *, imagines: bool
    ) -> None:
        """Judge all flights anew after an episode.

        Args:
            flown: (T, N), the episode's transitions.
            memory: (n, N), all that are stored.
            episode: which one it was, from 1.
            imagines: whether to look for better flights than those that were flown.
        """
        flights, expectation = self._flights, self._expectation
        judges = (episode + 1) % JUDGED_EVERY == 0
        if judges:
            expectation.update(memory, next(self.streams["guesses"]))
        way = expectation.variate.layout.position(flown["next", "observation"])
        flights.reward.copy_(expectation.of(flights.way)[0].nan_to_num(-torch.inf))
        flights.keep(flown["action"], way, expectation.of(way)[0])
        if imagines and self._imagination is not None:
            normals = next(self.streams["variations"])
            imagined = self._imagination.fly(episode, flights, normals)
            expected, guessed = expectation.of(imagined[1])
            flights.keep(*_highest(imagined, expected), expected.amax(dim=1))
            if judges:
                flights.try_next(*_highest(imagined, guessed))
        elif judges:
            flights.try_best()
        flights.compare(expectation.of(flights.own_way)[0])


def _highest(flights: tuple[Tensor, Tensor], values: Tensor) -> tuple[Tensor, Tensor]:
    """Of flights, actions and ways (T, N, D, 2), each learner's one of the highest value (N, D)."""
    index = values.argmax(dim=1)[None, :, None, None].expand(len(flights[0]), -1, 1, 2)
    actions, way = (torch.take_along_dim(each, index, dim=2).squeeze(2) for each in flights)
    return actions, way
