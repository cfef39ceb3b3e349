"""Flights that are judged before they are flown."""

import dataclasses
from typing import Any

import pytest
import torch

from hyuav import Scenario, make_env
from hyuav.learning.guide.demonstrations import BestFlights
from hyuav.learning.guide.proposals import Imagination
from hyuav.physics.slot import Physics

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=6)


DEAR = {"jamming_power": 1000.0}  # a helper that may jam has less left to fly
SMALL = {
    "map_side": 60.0,
    "max_speed": 19.0,
    "helper_starts": (-10.0, -10.0),
    "legitimate_position": (0.0, 0.0),
    "eavesdropper_positions": (20.0, 20.0),
    "ue_positions": ((5.0, 6.0), (-7.0, 8.0)),
}


def flights(scenario: Scenario) -> BestFlights:
    """The best hovers at the start, the one that was tried flies along x."""
    known = BestFlights(2, scenario)
    start = torch.tensor(scenario.helper_starts[0]) / (scenario.map_side / 2)
    known.way.copy_(start.expand_as(known.way))
    reach = scenario.max_speed * scenario.slot_duration / (scenario.map_side / 2)
    known.tried_way.copy_(known.way)
    known.tried_way[..., 0] += 0.5 * reach * torch.arange(1.0, scenario.num_slots + 1.0)[:, None]
    return known


def normals(imagined: int) -> torch.Tensor:
    return torch.randn(2, imagined, 5, generator=torch.Generator().manual_seed(0))


@pytest.mark.parametrize("changes", [{}, {"speed_limit": "disc"}, DEAR, SMALL])
@pytest.mark.parametrize("geofence", [False, True])
def test_the_environment_flies_what_was_imagined(changes: dict[str, Any], geofence: bool) -> None:
    scenario = dataclasses.replace(SCENARIO, **changes)
    schemes = ["hybrid", "relay"]
    imagination = Imagination(35, Physics(scenario), schemes)
    actions, way = imagination.fly(3, flights(scenario), normals(35))
    assert actions.shape == way.shape == (6, 2, 70, 2)
    env = make_env(scenario, schemes, (2, 70), seed=0, geofence=geofence)
    state, half_side = env.reset(), scenario.map_side / 2
    for action, place in zip(actions, way, strict=True):
        state = env.step_mdp(env.step(state.set("action", action)))
        assert not state["off_map"].any()
        flown = state["position"].squeeze(-2)
        torch.testing.assert_close(flown, place * half_side, atol=1e-3, rtol=0.0)
    straight = way[:, :, :35]
    assert torch.equal(straight[:, 0], straight[:, 1]) == (changes != DEAR)


def test_other_flights_are_imagined_in_every_episode_and_they_cover_what_can_be_reached() -> None:
    scenario = dataclasses.replace(SCENARIO, num_slots=10)
    imagination = Imagination(50, Physics(scenario), ["hybrid", "hybrid"])
    known, drawn = flights(scenario), normals(50)
    ways = [imagination.fly(episode, known, drawn)[1] for episode in range(40)]
    ends = torch.stack([way[-1, 0, :50] for way in ways]).flatten(0, 1)
    assert len(ends.unique(dim=0)) > 0.5 * len(ends)  # those at the edges coincide
    for corner in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 0.0), (-0.5, 0.6)):
        assert (ends - torch.tensor(corner)).norm(dim=-1).min() < 0.05


def test_variations_lead_beside_the_flights_that_they_vary() -> None:
    imagination = Imagination(400, Physics(SCENARIO), ["hybrid", "hybrid"])
    known = flights(SCENARIO)
    _, way = imagination.fly(1, known, normals(400))
    of_best, of_tried = way[:, :, 400:600], way[:, :, 600:]
    torch.testing.assert_close(of_best[:, :, 0], known.way)
    for varied, model in ((of_best, known.way), (of_tried, known.tried_way)):
        away = (varied - model.unsqueeze(2)).norm(dim=-1)
        assert (away > 1e-6).float().mean() > 0.3
        assert 0.0 < away[away > 1e-6].median() < 0.1
        assert away.max() < 1.0
    moved = (of_best - known.way.unsqueeze(2)).norm(dim=-1) > 1e-6
    first, last = moved[0].float().mean(), moved[-1].float().mean()
    assert min(first, last) > 0.3  # some from the first slot on, some to the last
    assert (~moved.all(dim=0)).float().mean() > 0.3  # and most not all along
