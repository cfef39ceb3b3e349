"""Actors and critics of many independent learners, stacked along a leading axis."""

import itertools
import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from hyuav.learning.afterstate import Afterstate

ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU}


class LearnerLinear(nn.Module):
    """One fully connected layer for each learner, applied as one batched product.

    Weights start as those of :class:`torch.nn.Linear`, drawn anew for each learner.

    Args:
        learners: N, the length of the learner axis.
        in_features: of each learner's layer.
        out_features: of each learner's layer.
        members: M, how many such layers each learner has, each for inputs of its own.
    """

    def __init__(
        self, learners: int, in_features: int, out_features: int, members: int | None = None
    ) -> None:
        super().__init__()
        bound = 1.0 / math.sqrt(in_features)
        rows = (learners,) if members is None else (members, learners)
        self.weight = nn.Parameter(torch.empty(*rows, in_features, out_features))
        self.bias = nn.Parameter(torch.empty(*rows, 1, out_features))
        for values in (self.weight, self.bias):
            nn.init.uniform_(values, -bound, bound)

    def forward(self, inputs: Tensor) -> Tensor:
        """Map (N, K, in_features) to (N, K, out_features); of members (M N, K, ...), M first."""
        weight, bias = self.weight.flatten(0, -3), self.bias.flatten(0, -3)
        return torch.bmm(inputs, weight) + bias  # a graph adds it for nothing


class LearnerMLP(nn.Module):
    """One multilayer perceptron for each learner.

    Args:
        learners: N.
        in_features: of the input.
        hidden_sizes: of the hidden layers.
        out_features: of the output.
        activation: of the hidden layers, a name of :data:`ACTIVATIONS`.
        output: applied to the last layer's result, if any.
        layer_norm: bring each hidden layer's sums to zero mean and unit variance (Ba et al.,
            2016), without weights of its own.
        members: how many such perceptrons each learner has; see :class:`LearnerLinear`.
    """

    def __init__(
        self,
        learners: int,
        in_features: int,
        hidden_sizes: Sequence[int],
        out_features: int,
        activation: str,
        output: nn.Module | None = None,
        *,
        layer_norm: bool = False,
        members: int | None = None,
    ) -> None:
        super().__init__()
        sizes = [in_features, *hidden_sizes]
        layers: list[nn.Module] = []
        for before, after in itertools.pairwise(sizes):
            layers.append(LearnerLinear(learners, before, after, members))
            if layer_norm:
                layers.append(nn.LayerNorm(after, elementwise_affine=False))
            layers.append(ACTIVATIONS[activation]())
        layers.append(LearnerLinear(learners, sizes[-1], out_features, members))
        self.layers = nn.Sequential(*layers)
        self.output = nn.Identity() if output is None else output

    def forward(self, *inputs: Tensor) -> Tensor:
        """Map inputs (N, ..., k) that join to ``in_features`` to (N, ..., out_features).

        A single slot of each learner, (N, k), is taken as well.
        """
        outputs: Tensor = self.output(_over_rows(self.layers, *inputs))
        return outputs

    def hidden(self, *inputs: Tensor) -> Tensor:
        """The same up to the last hidden layer's result."""
        return _over_rows(self.layers[:-1], *inputs)


def _over_rows(layers: nn.Module, *inputs: Tensor) -> Tensor:
    """Apply layers to inputs (N, ..., k), whatever lies between the learners and the features."""
    joined = inputs[0] if len(inputs) == 1 else torch.cat(inputs, dim=-1)
    learners, features = joined.shape[0], joined.shape[-1]
    outputs: Tensor = layers(joined.reshape(learners, -1, features))
    return outputs.reshape(*joined.shape[:-1], outputs.shape[-1])


class ScaledTanh(nn.Module):
    """A tanh times ``scale``, cut off at -1 and 1, which it so reaches where it is not yet flat.

    Args:
        scale: at least 1; a plain tanh for 1.
    """

    def __init__(self, scale: float) -> None:
        super().__init__()
        self.scale = scale

    def forward(self, inputs: Tensor) -> Tensor:
        """Map (...) to [-1, 1] (...)."""
        return (self.scale * inputs.tanh()).clamp(-1.0, 1.0)


class AfterstateCritic(nn.Module):
    """Q(s, a) by what (s, a) leads to.

    It is a sum, as the secrecy sum-rate is: of a part for each UE and helper, which counts as far
    as the helper covers it, and of one that always counts. So it need not learn how a UE's part
    ends at the edge of its coverage.

    Args:
        afterstate: of the scenario.
        network: maps its features to the 1 + H U parts.
    """

    def __init__(self, afterstate: Afterstate, network: LearnerMLP) -> None:
        super().__init__()
        self.afterstate, self.network = afterstate, network

    def forward(self, observation: Tensor, action: Tensor) -> Tensor:
        """Map observations (N, ..., observed) and actions to values (N, ..., 1)."""
        features = self.afterstate(observation, action)
        always, of_each_ue = self.network(features).tensor_split([1], dim=-1)
        covered = self.afterstate.coverage(features)
        values: Tensor = always + (covered * of_each_ue).sum(dim=-1, keepdim=True)
        return values
