"""What flights are expected to earn, by all that a learner remembers, and how sure that is."""

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from hyuav.learning.guide.control_variate import ControlVariate
from hyuav.learning.guide.parameters import Guide

POLYNOMIAL = 6
"""Terms of a square polynomial of the position."""


def feature_count(num_ues: int, hidden_size: int, most_ue_features: int) -> int:
    """F, of how many features rewards are regressed on.

    Args:
        num_ues: U.
        hidden_size: of the control variate's last hidden layer.
        most_ue_features: U up to which each UE has features of its own.
    """
    return hidden_size + 1 + POLYNOMIAL * num_ues * (num_ues <= most_ue_features)


class RewardModel(nn.Module):
    """Bayesian linear regression of the adjusted rewards of all slots that are remembered.

    A control variate's network follows its mini-batches, and jitters by more than good flights
    differ. So its last layer is solved anew for the whole memory, on the features that it has
    learned, as by Riquelme et al., "Deep Bayesian bandits showdown", ICLR 2018. Beside these stand,
    for each UE, the terms of a square polynomial of the helper's position, which count where the
    helper covers it: the secrecy sum-rate is a sum over UEs (eq. 6) and coverage a step (eq. 5),
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
        num_ues, most = variate.afterstate.num_ues, guide.most_ue_features
        self._of_each_ue = num_ues <= most
        self.size = feature_count(num_ues, guide.variate_hidden_sizes[-1], most)
        self.register_buffer("mean", torch.zeros(learners, self.size, 1))
        self.register_buffer("guess", torch.zeros(learners, self.size, 1))
        self.register_buffer("noise", torch.ones(learners, 1, 1))

    def features(self, place: Tensor, clock: Tensor) -> Tensor:
        """What rewards are regressed on: (N, ..., F).

        Args:
            place: (N, ..., 2) in units of half the map's side.
            clock: (N, ..., 1), what the clock shows there.
        """
        observed = self.variate.afterstate.at(place, clock)
        hidden = self.variate.network.hidden(observed)
        features = [hidden, torch.ones_like(clock)]
        if self._of_each_ue:
            x, y = place.split(1, dim=-1)
            terms = torch.cat([torch.ones_like(x), x, y, x * x, x * y, y * y], dim=-1)
            covered = self.variate.afterstate.coverage(observed) > 0.5
            features.append((covered.unsqueeze(-1) * terms.unsqueeze(-2)).flatten(-2))
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
        features = self.features(layout.position(following), layout.clock(following))
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
            trajectory: (T, N, ..., 2), where they lead, in units of half the map's side.
        """
        slots = torch.arange(1, len(trajectory) + 1, device=trajectory.device).to(trajectory.dtype)
        clock = (slots * (2.0 / len(trajectory)) - 1.0).reshape(-1, *[1] * (trajectory.ndim - 1))
        clock = clock.expand(*trajectory.shape[:-1], 1)
        features = self.features(trajectory.transpose(0, 1), clock.transpose(0, 1)).sum(dim=1)
        weights = torch.cat([self.mean, self.guess], dim=-1)
        flights = features.reshape(len(features), -1, self.size)
        both = torch.bmm(flights, weights).reshape(*features.shape[:-1], 2)
        expected, guessed = both.unbind(dim=-1)
        return expected, guessed
