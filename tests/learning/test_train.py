"""States that no training left, each refused before any of it is taken."""

import copy
from typing import Any

import pytest
import torch

from hyuav import InputError, Scenario
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.robust import RobustSAC
from hyuav.learning.learners import Learner
from hyuav.learning.training import Training, TrainingParameters

SCENARIO = Scenario(ue_positions=((1.0, 2.0), (-3.0, 4.0)), num_slots=2)
PARAMETERS = TrainingParameters(
    num_episodes=3, batch_size=2, replay_size=6, compile="never", evaluation_episodes=2, cohorts=1
)


def training(algorithm: Any = DDPG) -> Training:
    learners = [Learner("hybrid"), Learner("relay")]
    return Training(SCENARIO, learners, algorithm(hidden_sizes=(2,)), PARAMETERS)


@pytest.fixture(scope="module")
def flown() -> dict[str, Any]:
    """The state after two episodes."""
    own = training()
    episodes = own.episodes()
    next(episodes)
    next(episodes)
    return own.state_dict()


ACTOR = "actor_network_params.module.layers.0.weight"
NAN, INF = float("nan"), float("inf")
ODD: list[tuple[tuple[Any, ...], Any]] = [
    *((("episode",), odd) for odd in ("3", None, torch.ones(2), NAN, -1, 2**62, 1.5, True)),
    *((("updates",), odd) for odd in ("a", None, -1, 10**30)),
    *((("best_evaluation",), odd) for odd in (torch.zeros(3), None, torch.tensor([NAN, 0.0]))),
    (("best_evaluation",), torch.tensor([INF, 0.0])),
    *((("stopped",), odd) for odd in (torch.zeros(2), torch.tensor([0, 7]), torch.tensor([0, -1]))),
    *((("best_weights",), odd) for odd in ({}, None, {"weight": torch.zeros(2, 2)})),
    *((("best_weights", ACTOR), odd) for odd in (torch.zeros(2, 7, 3), 1.0)),
    (("best_weights", ACTOR), torch.full((2, 7, 2), NAN)),
    (("best_weights", ACTOR), torch.zeros(2, 7, 2, requires_grad=True)),
    (("best_weights", ACTOR), torch.zeros(2, 7, 2, device="meta")),
    (("best_weights", ACTOR), torch.zeros(2, 7, 2).to_sparse()),
    (("modules", f"loss.{ACTOR}"), torch.zeros(1, 7, 2)),
    *((("environment", name), odd) for name in ("fading", "tasks") for odd in (-1, 2**62, 10**30)),
    (("environment", "keys"), torch.zeros(2, 1)),
    (("random", "sampling", "drawn"), -3),
    (("random", "sampling"), None),
    (("optimizers",), []),
    (("optimizers", 0, "state", 0, "exp_avg"), torch.zeros(5)),
    (("optimizers", 0, "state", 0, "step"), torch.tensor(NAN)),
    (("optimizers", 0, "state", 99), {}),
    (("optimizers", 0, "param_groups", 0, "lr"), "fast"),
    (("optimizers", 0, "param_groups", 0, "betas"), (0.9, 2.0)),
    (("optimizers", 0, "param_groups", 0, "params"), [0, 0, 0, 0]),
    *((("replay_length",), odd) for odd in (-1, 7, "a")),
    *((("replay_cursor",), odd) for odd in (-1, 6, None)),
    (("replay",), {}),
    (("replay",), None),
    (("replay",), torch.zeros(6, 2)),
    (("replay", "next.reward"), torch.zeros(6, 2, 2)),
    (("slot", "step_count"), torch.full((2, 1), 9)),
    (("slot", "position"), torch.full((2, 1, 2), NAN)),
    (("slot", "observation"), torch.zeros(2, 9)),
    (("slot", "action"), torch.zeros(2, 2)),
    (("slot", "next"), torch.zeros(2, 2)),
]


@pytest.mark.parametrize(("path", "odd"), ODD)
def test_an_odd_entry_is_named_and_nothing_is_taken(
    flown: dict[str, Any], path: tuple[Any, ...], odd: Any
) -> None:
    state = copy.deepcopy(flown)
    holder = state["cohorts"][0]
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = odd
    taking = training()
    before = copy.deepcopy(taking.state_dict())
    with pytest.raises(InputError, match=r"^checkpoint: [^\n]*$") as refused:
        taking.load_state_dict(state)
    named = [str(key) for key in path if isinstance(key, str)]
    assert f"cohorts[0].{named[0]}" in str(refused.value)
    assert named[-1] in str(refused.value)
    assert torch.equal(
        taking.cohorts[0].best_weights[ACTOR], before["cohorts"][0]["best_weights"][ACTOR]
    )
    assert taking.episode == 0


@pytest.mark.parametrize("odd", [None, torch.zeros(3), [], {}, "a", {"cohorts": torch.zeros(1)}])
def test_what_is_no_state_is_refused(odd: Any) -> None:
    with pytest.raises(InputError, match=r"^checkpoint: not of a training like this one[^\n]*$"):
        training().load_state_dict(odd)


def test_weights_that_share_their_memory_are_given_memory_of_their_own(
    flown: dict[str, Any],
) -> None:
    """A file may say that they do; they are written to as training goes on."""
    state = copy.deepcopy(flown)
    spread = torch.zeros(1).expand(2, 7, 2)
    state["cohorts"][0]["best_weights"][ACTOR] = spread
    state["cohorts"][0]["optimizers"][0]["state"][0]["exp_avg"] = torch.zeros(1).expand(2, 9, 2)
    own = training()
    own.load_state_dict(state)
    assert [episode.number for episode in own.episodes()] == [3]


@pytest.mark.parametrize("algorithm", [DDPG, RobustSAC])
def test_a_state_fits_at_every_stage(algorithm: Any) -> None:
    own = training(algorithm)
    states = [own.state_dict()]
    training(algorithm).load_state_dict(own.state_dict())
    for _ in own.episodes():
        training(algorithm).load_state_dict(copy.deepcopy(own.state_dict()))
        own.load_state_dict(own.state_dict())
    own.load_state_dict(states[0])
