"""Copy, replace and hand over the weights of single learners on the learner axis.

Stacked weights have the learner axis third from the end, as :class:`.networks.LearnerLinear` has
them; twin critics add one axis in front. A learner's temperature has it in front of one more axis.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torchrl.objectives import LossModule

from hyuav._support.errors import InputError, brief
from hyuav._support.randomness import derived_seed


def _learner_axis(weights: Tensor) -> int:
    return -min(weights.ndim, 3)


def draw_weights(module: nn.Module, seeds: Sequence[int], stream: str) -> None:
    """Draw each learner's initial weights from its own seed, as PyTorch's linear layers are.

    Targets begin as copies. A learner's temperature is left as it is.

    Args:
        module: holding the networks of N learners.
        seeds: of the N learners.
        stream: which of each seed's random numbers to use.
    """
    generators = [torch.Generator().manual_seed(derived_seed(seed, stream)) for seed in seeds]
    networks = dict(module.named_parameters())
    for name, values in networks.items():
        layer, _, kind = name.rpartition(".")
        if kind not in ("weight", "bias"):
            continue
        bound = networks[f"{layer}.weight"].shape[-2] ** -0.5
        for learner, generator in enumerate(generators):
            own = values.data.select(-3, learner)
            # Alike on every device.
            drawn = torch.empty(own.shape, dtype=own.dtype, device=generator.device)
            own.copy_(drawn.uniform_(-bound, bound, generator=generator))
    begin_targets(module)


def begin_targets(module: nn.Module) -> None:
    """Let the target networks begin as copies of the networks."""
    networks = dict(module.named_parameters())
    for name, target in module.named_buffers():
        if name.startswith("target_"):
            target.copy_(networks[name.removeprefix("target_")].data)


def copy_weights(loss: LossModule) -> dict[str, Tensor]:
    """A copy of all networks and targets of N learners, by name, without hyperparameters."""
    return {
        name: values.detach().clone()
        for name, values in loss.state_dict().items()
        if values.ndim and not name.startswith("_value_estimator")
    }


def finite_learners(loss: LossModule) -> Tensor:
    """Whose weights are all finite numbers: (N,) bool."""
    largest = [
        values.detach().abs().movedim(_learner_axis(values), 0).flatten(1).amax(dim=1)
        for values in loss.parameters()
    ]  # NaN where one is; to ask each number whether it is finite takes many times as long
    return torch.stack(largest).isfinite().all(dim=0)


def replace_learners(weights: dict[str, Tensor], by: dict[str, Tensor], where: Tensor) -> None:
    """Overwrite, in ``weights``, the learners for which ``where`` (N,) is true."""
    for name, values in weights.items():
        values.copy_(torch.where(_mask(where, values), by[name], values))


def _mask(where: Tensor, values: Tensor) -> Tensor:
    """The learners (N,) in a shape that broadcasts against stacked weights."""
    return where.reshape(-1, *(1,) * (min(values.ndim, 3) - 1))


def begin_moments(optimizer: torch.optim.Optimizer) -> None:
    """Give an optimizer of Adam's kind the state that it would make in its first step."""
    for group in optimizer.param_groups:
        for weight in group["params"]:
            optimizer.state[weight] = {
                "step": torch.zeros((), dtype=torch.float32, device=weight.device),
                "exp_avg": torch.zeros_like(weight),
                "exp_avg_sq": torch.zeros_like(weight),
            }


def forget_moments(optimizer: torch.optim.Optimizer, where: Tensor) -> None:
    """Let the optimizer know nothing of the gradients of the learners ``where`` (N,)."""
    for state in optimizer.state.values():
        for name in ("exp_avg", "exp_avg_sq"):
            state[name].masked_fill_(_mask(where, state[name]), 0.0)


def count_learners(weights: dict[str, Tensor]) -> int:
    """Of how many learners the weights are."""
    values = next(iter(weights.values()))
    return values.shape[_learner_axis(values)]


def select_learners(weights: dict[str, Tensor], learners: Sequence[int]) -> dict[str, Tensor]:
    """A copy of the weights of these learners, in this order.

    Raises:
        InputError: some are of fewer learners.
    """
    for name, values in weights.items():
        for learner in learners:
            if not 0 <= learner < values.shape[_learner_axis(values)]:
                accepted = f"{learner + 1} learners or more"
                raise InputError(f"checkpoint: {brief(name)} is not of {accepted}")
    return {
        name: values.index_select(
            _learner_axis(values), torch.tensor(learners, device=values.device)
        )
        for name, values in weights.items()
    }


def join_learners(weights: Sequence[dict[str, Tensor]]) -> dict[str, Tensor]:
    """The weights of several sets of learners as those of one set, in their order."""
    return {
        name: torch.cat([each[name] for each in weights], dim=_learner_axis(values))
        for name, values in weights[0].items()
    }


def load_weights(loss: LossModule, weights: dict[str, Tensor]) -> None:
    """Put weights into the networks and targets; those of one learner serve all.

    Raises:
        InputError: other names or other shapes than the networks have.
    """
    own = copy_weights(loss)
    if own.keys() != weights.keys():
        raise InputError("checkpoint: its networks are not those of this algorithm")
    expanded = {}
    for name, values in weights.items():
        try:
            expanded[name] = values.expand_as(own[name])
        except RuntimeError:
            expected = f"{tuple(own[name].shape)} or one learner's"
            shape = tuple(values.shape)
            raise InputError(f"checkpoint: {name} has shape {shape}: expected {expected}") from None
    loss.load_state_dict(expanded, strict=False)
