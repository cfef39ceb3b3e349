"""What flights are expected to earn, by all that a learner remembers, and how sure that is."""

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from hyuav.learning.guide.control_variate import ControlVariate
from hyuav.learning.guide.parameters import Guide
from hyuav.physics.scenario import Scenario

POLYNOMIAL = 6
"""Terms of a square polynomial of the position."""


def feature_count(scenario: Scenario, hidden_size: int, most_ue_features: int) -> int:
    """F, of how many features rewards are regressed on.

    Args:
        scenario: its numbers of UEs U and helpers H.
        hidden_size: of the control variate's last hidden layer.
        most_ue_features: H U up to which each UE has features of its own.
    """
    covering = scenario.num_helpers * scenario.num_ues
    return hidden_size + 1 + POLYNOMIAL * covering * (covering <= most_ue_features)


class RewardModel(nn.Module):
    """Bayesian linear regression of the adjusted rewards of all slots that are remembered.

    A control variate's network follows its mini-batches, and jitters by more than good flights
    differ. So its last layer is solved anew for the whole memory, on the features that it has
    learned, as by Riquelme et al., "Deep Bayesian bandits showdown", ICLR 2018. Beside these stand,
    for each UE and helper, the terms of a square polynomial of its position, which count where it
    covers the UE: the secrecy sum-rate is a sum over UEs (eq. 6) and coverage a step (eq. 5),
    which a network blurs, so that a sliver that many circles share is not seen.

    The weights' posterior is Gaussian. One draw from it is one guess of what all flights earn; to
    try the flight that a guess holds best is Thompson sampling (Russo et al., "A tutorial on
    Thompson sampling", 2018): it tries what may be better than the best that is known, and stops
    where that has become unlikely.

    Args:
        learners: N.
        variate: of the N learners, whose weights are used and not changed.
        reward_scale: of the rewards that are stored, against bps/Hz.
        guide: its parameters.
    """

    mean: Tensor
    """(N, F, 1) of the posterior, in bps/Hz per feature."""
    guess: Tensor
    """(N, F, 1), a draw from it."""
    noise: Tensor
    """(N, 1, 1), variance of what the regression leaves unexplained, in (bps/Hz) squared."""

    def __init__(
        self, learners: int, variate: ControlVariate, reward_scale: float, guide: Guide
    ) -> None:
        super().__init__()
        self.variate, self._scale, self._guide = variate, reward_scale, guide
        scenario, most = variate.scenario, guide.most_ue_features
        self._of_each_ue = scenario.num_helpers * scenario.num_ues <= most
        self.size = feature_count(scenario, guide.variate_hidden_sizes[-1], most)
        self.register_buffer("mean", torch.zeros(learners, self.size, 1))
        self.register_buffer("guess", torch.zeros(learners, self.size, 1))
        self.register_buffer("noise", torch.ones(learners, 1, 1))

    def features(self, place: Tensor, clock: Tensor) -> Tensor:
        """What rewards are regressed on: (N, ..., F).

        Args:
            place: (N, ..., actions), as for :class:`ControlVariate`.
            clock: (N, ..., 1), what the clock shows there.
        """
        observed = self.variate.afterstate.at(place, clock)
        hidden = self.variate.network.hidden(observed)
        features = [hidden, torch.ones_like(clock)]
        if self._of_each_ue:
            x, y = self.variate.layout.by_helper(place)[0].split(1, dim=-1)
            terms = torch.cat([torch.ones_like(x), x, y, x * x, x * y, y * y], dim=-1)
            covered = self.variate.afterstate.coverage(observed) > 0.5
            covered = covered.unflatten(-1, (self.variate.layout.num_helpers, -1))
            features.append((covered.unsqueeze(-1) * terms.unsqueeze(-2)).flatten(-3))
        return torch.cat(features, dim=-1)

    @torch.no_grad()
    def update(self, memory: TensorDictBase, normals: Tensor) -> None:
        """Learn from all that is remembered, and make another guess.

        Args:
            memory: (n, N) transitions as they are stored, with their fading.
            normals: (N, F), standard normal, which decide on the guess.
        """
        memory = memory.transpose(0, 1)
        following = memory["next", "observation"]
        layout = self.variate.layout
        features = self.features(layout.place(memory), layout.clock(following))
        control_term = self.variate.control_term(memory)
        adjusted = (memory["next", "reward"] - control_term) / self._scale
        transposed = features.transpose(1, 2)
        products = torch.bmm(transposed, features).double()
        diagonal = products.diagonal(dim1=1, dim2=2)
        least = self._guide.least_noise * diagonal.mean(dim=1).reshape(-1, 1, 1)
        prior = self.noise.double().maximum(least)
        identity = torch.eye(self.size, dtype=products.dtype, device=products.device)
        equations = products + prior * identity
        root, failed = torch.linalg.cholesky_ex(equations)
        mean = torch.cholesky_solve(torch.bmm(transposed, adjusted).double(), root)
        deviation = torch.linalg.solve_triangular(
            root.transpose(1, 2), normals.double().unsqueeze(-1), upper=True
        )
        guess = mean + self._guide.posterior_scale * self.noise.double().sqrt() * deviation
        rest = (adjusted - torch.bmm(features, mean.float())).square().mean(dim=1, keepdim=True)
        solved = (failed == 0).reshape(-1, 1, 1) & rest.isfinite()
        for kept, found in ((self.mean, mean), (self.guess, guess), (self.noise, rest)):
            kept.copy_(torch.where(solved, found.to(kept.dtype), kept))

    @torch.no_grad()
    def judge(self, trajectory: Tensor) -> tuple[Tensor, Tensor]:
        """What is to be expected of flights and what the last guess holds: (N, ...) bps/Hz each.

        Args:
            trajectory: (T, N, ..., actions), where they lead.
        """
        features = self._features_of(trajectory).sum(dim=1)
        flights = features.reshape(len(features), -1, self.size)
        both = torch.bmm(flights, self._both).reshape(*features.shape[:-1], 2)
        expected, guessed = both.unbind(dim=-1)
        return expected, guessed

    @torch.no_grad()
    def choose(self, candidates: Tensor) -> tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]]:
        """The best flights that take one of some candidates in each slot.

        Args:
            candidates: (T, N, D, C, actions), C for each slot of D flights.

        Returns:
            what is to be expected of them (N, D) in bps/Hz, and which candidates they take (T, N,
            D) int64; and the same of what the last guess holds.
        """
        features = self._features_of(candidates)
        slots = torch.bmm(features.reshape(len(features), -1, self.size), self._both)
        values, index = slots.reshape(*features.shape[:-1], 2).max(dim=-2)
        returns, index = values.sum(dim=1), index.transpose(0, 1)
        return (returns[..., 0], index[..., 0]), (returns[..., 1], index[..., 1])

    @property
    def _both(self) -> Tensor:
        """The weights of what is to be expected and of the guess: (N, F, 2)."""
        return torch.cat([self.mean, self.guess], dim=-1)

    def _features_of(self, trajectory: Tensor) -> Tensor:
        """The features of each slot of flights (T, N, ..., actions): (N, T, ..., F)."""
        slots = torch.arange(1, len(trajectory) + 1, device=trajectory.device).to(trajectory.dtype)
        clock = (slots * (2.0 / len(trajectory)) - 1.0).reshape(-1, *[1] * (trajectory.ndim - 1))
        clock = clock.expand(*trajectory.shape[:-1], 1)
        return self.features(trajectory.transpose(0, 1), clock.transpose(0, 1))
