"""The paper's Algorithm 1 on one screen, from TorchRL's parts alone: copy it, and change it.

hyuav copy algorithm1
python algorithm1.py
"""

import torch
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import nn
from torchrl import torchrl_logger
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, ReplayBuffer
from torchrl.modules import MLP, ValueOperator
from torchrl.objectives import DDPGLoss, SoftUpdate, ValueEstimators

from hyuav import make_env


class Noise(nn.Module):
    """The noise process of Algorithm 1: Gaussian, decaying from slot to slot."""

    def __init__(self, variance: float, decay: float) -> None:
        super().__init__()
        self.std, self.decay = variance**0.5, decay

    def forward(self, action: torch.Tensor) -> torch.Tensor:
        """Map actions (2,) to noisy ones in [-1, 1], in units of v_max."""
        noisy = action + self.std * torch.randn_like(action)
        self.std *= self.decay
        return noisy.clamp(-1.0, 1.0)


def train(
    scenario: str = "two_clusters",
    scheme: str = "hybrid",
    episodes: int = 1000,
    batch_size: int = 70,
    seed: int = 0,
) -> tuple[TensorDictModule, list[float]]:
    """Train one helper with DDPG.

    Args:
        scenario: a preset, or a :class:`hyuav.Scenario`.
        scheme: who chooses the mode: hybrid, relay or jamming.
        episodes: to fly.
        batch_size: K.
        seed: of everything that is random.

    Returns:
        the actor mu, and what each episode brought in bps/Hz, with noise.
    """
    torch.manual_seed(seed)
    env = make_env(scenario, scheme, seed=seed)
    observed, flown = env.observation_spec["observation"].shape[-1], env.action_spec.shape[-1]

    # 1: actor, critic, their targets, and the replay buffer
    layers = {"num_cells": [300, 100, 100], "activation_class": nn.Tanh}
    network = nn.Sequential(MLP(in_features=observed, out_features=flown, **layers), nn.Tanh())
    actor = TensorDictModule(network, in_keys=["observation"], out_keys=["action"])
    critic = ValueOperator(
        MLP(in_features=observed + flown, out_features=1, **layers),
        in_keys=["observation", "action"],
    )
    loss = DDPGLoss(actor, critic, loss_function="l2", delay_actor=True, delay_value=True)
    loss.make_value_estimator(ValueEstimators.TD0, gamma=0.95)
    targets = SoftUpdate(loss, tau=0.005)
    critic_optimizer = torch.optim.Adam(critic.parameters(), lr=1e-4)
    actor_optimizer = torch.optim.Adam(actor.parameters(), lr=1e-4)
    replay = ReplayBuffer(storage=LazyTensorStorage(8000), batch_size=batch_size)

    noise = TensorDictModule(Noise(0.6, 0.999), in_keys=["action"], out_keys=["action"])
    explorer = TensorDictSequential(actor, noise)
    collector = Collector(
        env, explorer, frames_per_batch=1, total_frames=-1, auto_register_policy_transforms=False
    )
    earned: list[float] = []
    for slot in collector:  # 2 to 11: fly one slot in the better mode
        replay.extend(slot)  # 12: store the transition
        if len(replay) >= batch_size:
            batch = replay.sample()  # 13: a mini-batch of K transitions
            for loss_of, optimizer in (
                (loss.loss_value, critic_optimizer),  # 14: the critic by eq. 9
                (loss.loss_actor, actor_optimizer),  # and the actor by eq. 10
            ):
                optimizer.zero_grad()
                loss_of(batch)[0].backward()
                optimizer.step()
            targets.step()  # 15: the targets follow
        if slot["next", "done"].any():
            earned.append(slot["next", "episode_reward"].item())
            print(f"episode {len(earned)}: {earned[-1]:.2f} bps/Hz", flush=True)
            if len(earned) == episodes:
                break
    return actor, earned


if __name__ == "__main__":
    torchrl_logger.setLevel("WARNING")  # or it would tell of its storage
    train()
