"""Hold a training on the GPU beside the same on the CPU, and measure how fast the GPU is.

python examples/gpu.py
"""

import dataclasses
import time

import torch
from torch import Tensor

from hyuav import DDPG, Guide, Learner, RobustDDPG, Scenario, Training, TrainingParameters, make_env
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.sac import SAC

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=10)
SHORT = RobustDDPG(guide=Guide(warm_up_episodes=5))


def train(
    algorithm: AlgorithmParameters, device: str, *, compiled: bool, learners: int, episodes: int
) -> tuple[Tensor, float]:
    """Rewards (episodes, learners), and the seconds of a slot in the last third."""
    parameters = TrainingParameters(
        num_episodes=episodes, evaluation_every=5, compile="always" if compiled else "never"
    )
    several = [Learner(seed=seed) for seed in range(learners)]
    training = Training(SCENARIO, several, algorithm, parameters, device)
    rewards, ends = [], []
    for episode in training.episodes():
        rewards.append(episode.accumulated_reward.cpu())
        ends.append(time.perf_counter())
    last = episodes // 3
    return torch.stack(rewards), (ends[-1] - ends[-1 - last]) / (last * SCENARIO.num_slots)


def fly(helpers: int, *, compiled: bool) -> float:
    """Slots per second of that many helpers."""
    env = make_env("two_clusters", "hybrid", (helpers,), "cuda", seed=0, compiled=compiled)
    state, action = env.reset(), torch.zeros(helpers, 2, device="cuda")
    with torch.no_grad():
        for slot in range(18):
            if slot == 3:
                torch.cuda.synchronize()
                begun = time.perf_counter()
            state = env.step_mdp(env.step(state.set("action", action)))
    torch.cuda.synchronize()
    return 15 * helpers / (time.perf_counter() - begun)


def main() -> None:
    """Print what was found."""
    print(f"PyTorch {torch.__version__}, {torch.cuda.get_device_name()}")
    for algorithm in (DDPG(), SHORT, SAC()):
        name = type(algorithm).__name__
        expected, _ = train(algorithm, "cpu", compiled=False, learners=3, episodes=20)
        for compiled in (False, True):
            found, _ = train(algorithm, "cuda", compiled=compiled, learners=3, episodes=20)
            apart = (found - expected).abs().max()
            print(f"{name}, compiled={compiled}: at most {apart:.1e} bps/Hz from the CPU's rewards")
    for helpers in (65_536, 1_048_576):
        for compiled in (False, True):
            rate = fly(helpers, compiled=compiled)
            print(f"environment, {helpers:,} helpers, compiled={compiled}: {rate:,.0f} slots/s")
    for learners in (16, 256, 4096):
        for algorithm in (DDPG(), SHORT):
            _, seconds = train(algorithm, "cuda", compiled=True, learners=learners, episodes=60)
            rate = learners / seconds
            print(f"{type(algorithm).__name__}, {learners} learners: {rate:,.0f} steps/s")


if __name__ == "__main__":
    main()
