import math

import pytest
import torch
from torch import nn

from hyuav import Scenario
from hyuav.learning.afterstate import Afterstate
from hyuav.learning.networks import AfterstateCritic, LearnerLinear, LearnerMLP, ScaledTanh


def test_each_learner_has_a_layer_of_its_own() -> None:
    stacked, inputs = LearnerLinear(3, 5, 4), torch.randn(3, 7, 5)
    outputs = stacked(inputs)
    for learner in range(3):
        alone = nn.functional.linear(
            inputs[learner], stacked.weight[learner].T, stacked.bias[learner, 0]
        )
        torch.testing.assert_close(outputs[learner], alone)


def test_fresh_weights_have_the_distribution_of_a_linear_layer() -> None:
    torch.manual_seed(0)
    stacked, alone = LearnerLinear(50, 100, 40), nn.Linear(100, 40)
    bound = 1 / math.sqrt(100)
    assert stacked.weight.abs().max() <= bound
    assert stacked.weight.std().item() == pytest.approx(bound / math.sqrt(3), rel=0.01)
    assert alone.weight.std().item() == pytest.approx(bound / math.sqrt(3), rel=0.05)
    assert not torch.equal(stacked.weight[0], stacked.weight[1])


@pytest.mark.parametrize("batch", [(), (6,), (6, 4)])
def test_networks_take_any_batch_behind_the_learner_axis(batch: tuple[int, ...]) -> None:
    observation, action = torch.randn(2, *batch, 15), torch.randn(2, *batch, 2)
    assert LearnerMLP(2, 15, (8, 4), 2, "tanh")(observation).shape == (2, *batch, 2)
    assert LearnerMLP(2, 17, (8, 4), 1, "tanh")(observation, action).shape == (2, *batch, 1)


def test_hidden_layers_have_the_sizes_of_the_paper_by_default() -> None:
    network = LearnerMLP(1, 15, (300, 100, 100), 2, "tanh")
    shapes = [
        layer.weight.shape[1:] for layer in network.modules() if isinstance(layer, LearnerLinear)
    ]
    assert shapes == [(15, 300), (300, 100), (100, 100), (100, 2)]


def test_a_scaled_tanh_reaches_full_speed_where_it_is_not_flat() -> None:
    scaled = ScaledTanh(1.04)
    inputs = torch.tensor([-9.0, -2.0, 0.0, 0.5, 2.0, 9.0])
    expected = torch.tensor([-1.0, -1.0, 0.0, 1.04 * math.tanh(0.5), 1.0, 1.0])
    torch.testing.assert_close(scaled(inputs), expected)


def test_normalized_layers_do_not_depend_on_the_scale_of_their_inputs() -> None:
    network = LearnerMLP(1, 3, (8,), 1, "tanh", layer_norm=True)
    network.get_parameter("layers.0.bias").data.zero_()
    inputs = torch.randn(1, 5, 3)
    torch.testing.assert_close(network(inputs), network(10.0 * inputs), rtol=1e-3, atol=1e-4)


def test_a_critic_counts_of_each_ue_what_is_covered() -> None:
    scenario = Scenario.preset("two_clusters")
    afterstate = Afterstate(scenario, 0.02, clock=False, geofence=False)
    critic = AfterstateCritic(afterstate, LearnerMLP(1, afterstate.size, (8,), 11, "tanh"))
    for weight in critic.network.parameters():
        weight.data.zero_()
    worth = torch.tensor([0.5, *range(1, 11)])  # always, then of each UE
    critic.network.get_parameter("layers.2.bias").data[0, 0] = worth
    places = torch.tensor([[[0.9, 0.9], [-0.25, 0.2], [0.23, -0.22]]])
    observation = torch.cat([places, torch.zeros(1, 3, 13)], dim=-1)
    values = critic(observation, torch.zeros(1, 3, 2)).squeeze()
    first, second = worth[1:8].sum(), worth[8:].sum()  # of the clusters
    torch.testing.assert_close(
        values, 0.5 + torch.stack([0.0 * first, first, second]), atol=0.1, rtol=0.0
    )
