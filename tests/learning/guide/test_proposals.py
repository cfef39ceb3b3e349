"""Flights that are judged before they are flown."""

import dataclasses
from typing import Any

import pytest
import torch

from hyuav import Guide, Scenario, make_env
from hyuav.envs.observation import ObservationLayout
from hyuav.learning.guide.demonstrations import Demonstrations
from hyuav.learning.guide.proposals import TrajectoryProposals
from hyuav.physics.slot import Physics

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=6)


SCHEMES = ["hybrid", "relay"]
DEAR = {"jamming_power": 1000.0}  # a helper that may jam has less left to fly
SMALL = {
    "map_side": 60.0,
    "max_speed": 19.0,
    "helper_starts": (-10.0, -10.0),
    "legitimate_position": (0.0, 0.0),
    "eavesdropper_positions": (20.0, 20.0),
    "ue_positions": ((5.0, 6.0), (-7.0, 8.0)),
}


def flights(scenario: Scenario) -> Demonstrations:
    """The best hovers at the start, the one that is planned flies along x."""
    known = Demonstrations(2, scenario, 0.005)
    places = torch.tensor(scenario.helper_starts) / (scenario.map_side / 2)
    powers = torch.full((scenario.num_helpers, scenario.action_size - 2), 0.5)
    start = torch.cat([places, powers], dim=-1).flatten()
    known.trajectory.copy_(start.expand_as(known.trajectory))
    reach = scenario.max_speed * scenario.slot_duration / (scenario.map_side / 2)
    known.planned_trajectory.copy_(known.trajectory)
    slots = torch.arange(1.0, scenario.num_slots + 1.0)[:, None]
    known.planned_trajectory[..., 0] += 0.5 * reach * slots
    return known


def proposing(imagined: int, scenario: Scenario = SCENARIO) -> TrajectoryProposals:
    system = Physics(scenario)
    return TrajectoryProposals(Guide(imagined_flights=imagined), system, SCHEMES)


def normals(imagined: int, num_helpers: int = 1) -> torch.Tensor:
    generator = torch.Generator().manual_seed(0)
    return torch.randn(2, imagined, 3 + 2 * num_helpers, generator=generator)


SEVERAL = {"helper_starts": ((-60.0, -60.0), (60.0, -60.0)), "power_control": True, **DEAR}


@pytest.mark.parametrize("changes", [{}, {"speed_limit": "disc"}, DEAR, SMALL, SEVERAL])
@pytest.mark.parametrize("geofence", [False, True])
def test_the_environment_flies_what_was_imagined(changes: dict[str, Any], geofence: bool) -> None:
    scenario = dataclasses.replace(SCENARIO, **changes)
    proposals = proposing(35, scenario)
    size = scenario.num_helpers * scenario.action_size
    actions, trajectory = proposals.fly(3, flights(scenario), normals(35, scenario.num_helpers))
    assert actions.shape == trajectory.shape == (6, 2, 70, size)
    env = make_env(scenario, SCHEMES, (2, 70), seed=0, geofence=geofence)
    state, half_side = env.reset(), scenario.map_side / 2
    for action, place in zip(actions, trajectory, strict=True):
        slot = env.step(state.set("action", action))
        state = env.step_mdp(slot)
        assert not state["off_map"].any()
        flown = ObservationLayout(scenario, clock=False).place(slot)
        torch.testing.assert_close(flown, place, atol=1e-3 / half_side, rtol=0.0)
    straight = trajectory[:, :, :35]
    assert torch.equal(straight[:, 0], straight[:, 1]) == ("jamming_power" not in changes)


def test_other_flights_are_imagined_in_every_episode_and_they_cover_what_can_be_reached() -> None:
    scenario = dataclasses.replace(SCENARIO, num_slots=10)
    proposals = proposing(50, scenario)
    known, drawn = flights(scenario), normals(50)
    trajectories = [proposals.fly(episode, known, drawn)[1] for episode in range(40)]
    ends = torch.stack([trajectory[-1, 0, :50] for trajectory in trajectories]).flatten(0, 1)
    assert len(ends.unique(dim=0)) > 0.5 * len(ends)  # those at the edges coincide
    for corner in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 0.0), (-0.5, 0.6)):
        assert (ends - torch.tensor(corner)).norm(dim=-1).min() < 0.05


def test_variations_lead_beside_the_flights_that_they_vary() -> None:
    proposals = proposing(400)
    known = flights(SCENARIO)
    _, trajectory = proposals.fly(1, known, normals(400))
    of_best, of_planned = trajectory[:, :, 400:600], trajectory[:, :, 600:]
    torch.testing.assert_close(of_best[:, :, 0], known.trajectory)
    for varied, model in ((of_best, known.trajectory), (of_planned, known.planned_trajectory)):
        away = (varied - model.unsqueeze(2)).norm(dim=-1)
        assert (away > 1e-6).float().mean() > 0.3
        assert 0.0 < away[away > 1e-6].median() < 0.1
        assert away.max() < 1.0
    moved = (of_best - known.trajectory.unsqueeze(2)).norm(dim=-1) > 1e-6
    first, last = moved[0].float().mean(), moved[-1].float().mean()
    assert min(first, last) > 0.3  # some from the first slot on, some to the last
    assert (~moved.all(dim=0)).float().mean() > 0.3  # and most not all along
