"""Weights to begin with that know what the generalist knows: actors that imitate its flights."""

import dataclasses

import torch
from tensordict import TensorDict
from torch import Tensor

from hyuav.envs.transforms import make_env
from hyuav.experiments.run_directory import RunConfiguration
from hyuav.learning.algorithm import made_on
from hyuav.learning.generalist.pretrained import pretrained
from hyuav.learning.learners import Learner
from hyuav.learning.weights import begin_targets, copy_weights, draw_weights

FLIGHTS = 32
"""Of the generalist in each learner's scenario, from which its actor learns."""

NOISE = 0.3
"""Standard deviation, in units of the largest actions, by which these flights are led astray."""

STATES = 256
"""Of them, from which every learner's actor learns."""

STEPS, LEARNING_RATE = 800, 1e-3


def cloned_weights(configuration: RunConfiguration) -> dict[str, Tensor]:
    """Weights of all learners whose actors act as the generalist does, near its own flights.

    The paper begins with weights of which a higher reward is known. The critics are fresh.

    Args:
        configuration: of the training to come.
    """
    learners = configuration.learners
    with made_on(torch.device("cpu")):
        algorithm = configuration.algorithm.build(len(learners), configuration.scenario)
    draw_weights(algorithm.loss, [learner.seed for learner in learners], "cloning")
    flown = [_flown(configuration, learner) for learner in learners]
    wanted = torch.stack([own["wanted"] for own in flown])
    seen = TensorDict({"observation": torch.stack([own["observation"] for own in flown])})
    seen.batch_size = wanted.shape[:-1]
    optimizer = torch.optim.Adam(
        list(algorithm.loss.actor_network_params.parameters()), LEARNING_RATE
    )
    for _ in range(STEPS):
        error = (algorithm.act(seen.copy()) - wanted).square().mean(dim=(1, 2)).sum()
        optimizer.zero_grad()
        error.backward()
        optimizer.step()
    begin_targets(algorithm.loss)
    return copy_weights(algorithm.loss)


@torch.no_grad()
def _flown(configuration: RunConfiguration, learner: Learner) -> TensorDict:
    """What the generalist does in states about its flights: (STATES,) of both."""
    horizon = learner.horizon(configuration.scenario)
    scenario = dataclasses.replace(configuration.scenario, num_slots=horizon)
    policy = pretrained("generalist").policy(scenario, learner.scheme)
    env = make_env(
        scenario,
        learner.scheme,
        batch_size=(FLIGHTS,),
        seed=learner.seed,
        clock=configuration.algorithm.clock,
        geofence=configuration.algorithm.geofence,
    )
    generator = torch.Generator().manual_seed(learner.seed)
    state, kept = env.reset(), []
    for _ in range(horizon):
        action = policy(state)["action"]
        kept.append(
            TensorDict(
                {"observation": state["observation"], "wanted": action}, batch_size=[FLIGHTS]
            )
        )
        astray = NOISE * torch.randn(action.shape, generator=generator)
        astray[0] = 0.0
        state["action"] = (action + astray).clamp(-1.0, 1.0)
        state = env.step_mdp(env.step(state))
    states = torch.cat(kept)
    return states[torch.randint(len(states), (STATES,), generator=generator)]
