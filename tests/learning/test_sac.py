import torch
from tensordict import TensorDict
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.objectives import SACLoss, ValueEstimators

from batches import TEN_UES, mini_batch
from hyuav.learning.sac import SAC
from hyuav.learning.train import update_networks


def test_every_learner_has_a_temperature_of_its_own() -> None:
    torch.manual_seed(0)
    algorithm = SAC(hidden_sizes=(8,), temperature_learning_rate=0.05).build(3, TEN_UES)
    batch = mini_batch(3, 40)
    for index in range(1, 10):
        update_networks(algorithm, batch, index)
    temperatures = algorithm.loss.log_alpha.exp().flatten()
    assert temperatures.shape == (3,)
    assert len(set(temperatures.tolist())) == 3


def test_with_one_learner_the_losses_are_torchrls() -> None:
    torch.manual_seed(0)
    ours = SAC(hidden_sizes=(8,), temperature_init=0.3).build(1, TEN_UES)
    theirs = SACLoss(
        ours.explorer,
        SAC(hidden_sizes=(8,)).make_critic(1, TEN_UES),
        alpha_init=0.3,
        target_entropy=-2.0,
        loss_function="l2",
        reduction="mean",
    )
    theirs.make_value_estimator(ValueEstimators.TD0, gamma=0.95)
    state = {name: v for name, v in ours.loss.state_dict().items() if name != "log_alpha"}
    theirs.load_state_dict(state, strict=False)
    batch = mini_batch(1, 40)
    critic, actor = (step.loss for step in ours.steps)
    torch.manual_seed(5)
    mine = critic(batch.clone()).mean(), actor(batch.clone()).mean()
    torch.manual_seed(5)
    value_loss, _ = theirs.qvalue_v2_loss(batch.clone())
    actor_loss, metadata = theirs.actor_loss(batch.clone())
    expected = value_loss, actor_loss + theirs.alpha_loss(metadata["log_prob"]).mean()
    torch.testing.assert_close(mine, expected)


def test_a_scale_brings_the_noise_free_action_to_full_speed() -> None:
    torch.manual_seed(0)
    plain, scaled = (
        SAC(hidden_sizes=(8,), action_scale=scale).build(2, TEN_UES) for scale in (1.0, 1.5)
    )
    scaled.loss.load_state_dict(plain.loss.state_dict())
    data = TensorDict(observation=3.0 * torch.randn(2, 40, 15), batch_size=[2, 40])
    action = plain.actor(data.clone())["action"]
    expected = (1.5 * action).clamp(-1.0, 1.0)
    assert expected.abs().max() == 1.0
    torch.testing.assert_close(scaled.actor(data.clone())["action"], expected)
    torch.testing.assert_close(scaled.act(data), expected)


def test_the_noise_free_action_is_the_mode_of_the_explored_ones() -> None:
    algorithm = SAC(hidden_sizes=(8,)).build(2, TEN_UES)
    data = TensorDict(observation=torch.randn(2, 9, 15), batch_size=[2, 9])
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        expected = algorithm.explorer(data.clone())["action"]
    torch.testing.assert_close(algorithm.actor(data.clone())["action"], expected)
