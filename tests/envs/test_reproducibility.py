"""A seed brings the same flights in every version."""

import dataclasses
from typing import Any

import pytest
import torch

from hyuav import Scenario, make_env

MODES = ("hybrid", "relay", "jamming")
SLOTS, BATCH = 20, 8


def actions() -> torch.Tensor:
    """Of all slots (T, batch, 2): to all sides, over the edges of the map and beyond [-1, 1]."""
    drift = torch.linspace(-torch.pi, torch.pi, BATCH + 1)[1:]
    drift = 0.7 * torch.stack([drift.cos(), drift.sin()], dim=-1)
    generator = torch.Generator().manual_seed(11)
    return drift + 0.6 * torch.randn(SLOTS, BATCH, 2, generator=generator)


@pytest.mark.parametrize(
    ("changes", "scheme", "seed", "returns"),
    [
        ({}, "hybrid", 7, "8.491 8.0134 2.6629 17.5159 14.2502 23.6416 15.6727 4.3461"),
        (
            {},
            [*MODES, *MODES, "hybrid", "relay"],
            [3, 1, 4, 1, 5, 9, 2, 6],
            "10.5576 -2.8 3.0708 24.3537 3.1189 13.3896 17.9142 -3.4",
        ),
        (
            {"edge_energy_budget": 3.0, "helper_energy_budget": 900.0, "speed_limit": "disc"},
            *("hybrid", 7),
            "9.4321 7.8184 2.326 12.2629 10.2339 21.9268 14.7916 3.729",
        ),
    ],
    ids=["one seed", "seeds of rows", "budgets"],
)
def test_seeded_flights_earn_what_they_earned_in_the_first_version(
    changes: dict[str, Any], scheme: Any, seed: Any, returns: str
) -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=SLOTS, **changes)
    env = make_env(scenario, scheme, (BATCH,), seed=seed)
    state = env.reset()
    for action in actions():
        state["action"] = action
        state = env.step_mdp(env.step(state))
    expected = [float(value) for value in returns.split()]
    assert state["episode_reward"].flatten().tolist() == pytest.approx(expected, abs=2e-4)
