"""What is kept of flights for pictures, and the pictures of TorchRL's environments."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.envs import EnvBase
from torchrl.record import PixelRenderTransform, VideoRecorder
from torchrl.record.loggers import CSVLogger

from hyuav import InputError, Scenario, SecureOffloadingEnv, make_env
from hyuav.envs.recorder import MOST_SLOTS, FlightRecorder
from hyuav.envs.rendering import render_frame
from reference import place

SCENARIO = Scenario.preset("two_clusters")
SHORT = dataclasses.replace(SCENARIO, num_slots=3)


def path_of(flights: TensorDictBase, row: tuple[int, ...]) -> Any:
    """Positions (t + 1, 2) and modes (t + 1,) of one row of a rollout."""
    slots, after = flights[row], flights["next"][row]
    modes = torch.cat([slots["mode"][:1], after["mode"]])
    return torch.cat([place(slots)[:1], place(after)]), modes.squeeze(-1)


@pytest.mark.parametrize("batch_size", [(), (3,), (2, 2)])
@pytest.mark.parametrize("make", [SecureOffloadingEnv, make_env])
def test_a_picture_shows_the_first_row_s_flight_since_its_reset(
    make: Any, batch_size: tuple[int, ...]
) -> None:
    env: EnvBase = make(SCENARIO, batch_size=batch_size, seed=0)
    flights = env.rollout(5)
    picture = env.render()
    assert (picture.shape, picture.dtype) == ((520, 760, 3), np.uint8)
    expected = render_frame(SCENARIO, *path_of(flights, (0,) * len(batch_size)))
    np.testing.assert_array_equal(picture, expected)
    env.reset()
    assert (env.render() != picture).any()


def test_a_picture_shows_the_row_s_own_layout() -> None:
    layouts = [SCENARIO, dataclasses.replace(SCENARIO, ue_positions=((0.0, 0.0),) * 10)]
    env = make_env(layouts, batch_size=(2, 3), seed=0)
    env.base_env.recorder = FlightRecorder(6, SCENARIO.num_slots)
    flights = env.rollout(2)
    expected = render_frame(layouts[1], *path_of(flights, (1, 0)))
    np.testing.assert_array_equal(env.render(row=3), expected)


def test_a_row_that_is_reset_begins_anew_and_the_others_fly_on() -> None:
    env = make_env(SCENARIO, batch_size=3, seed=0)
    env.base_env.recorder = FlightRecorder(3, SCENARIO.num_slots)
    flights = env.rollout(4)
    state = env.step_mdp(flights[:, -1])
    state["_reset"] = torch.tensor([[False], [True], [False]])
    state = env.reset(state)
    flown = env.step(state.set("action", torch.zeros(3, 2)))["next"]
    positions, modes, count = env.base_env.recorder.flight(1)
    torch.testing.assert_close(positions, torch.stack([state["position"][1], flown["position"][1]]))
    assert (len(modes), count) == (2, 1)
    positions, _, count = env.base_env.recorder.flight(2)
    kept, _ = path_of(flights, (2,))
    torch.testing.assert_close(positions[:, 0], torch.cat([kept, place(flown)[2:]]))
    assert count == 5


def test_of_a_longer_flight_the_latest_slots_are_kept() -> None:
    env = SecureOffloadingEnv(SHORT, seed=0)
    flights = env.rollout(8)
    positions, _, count = env.recorder.flight(0)
    torch.testing.assert_close(positions[:, 0], place(flights["next"])[-4:])
    assert count == 8


def test_of_a_flight_without_end_no_more_is_kept_than_a_picture_shows() -> None:
    recorder = FlightRecorder(1, 10**6)

    def observed(slot: int) -> TensorDict:
        return TensorDict(position=torch.full((1, 2), float(slot)), mode=torch.ones(1))

    recorder.start(observed(0))
    for slot in range(1, MOST_SLOTS + 6):
        recorder.add(observed(slot))
    positions, modes, count = recorder.flight(0)
    assert count == MOST_SLOTS + 5
    assert len(positions) == len(modes) == MOST_SLOTS + 1
    assert positions[0].tolist() == [[5.0, 5.0]]


def test_nothing_is_drawn_before_a_reset_or_of_a_row_that_is_not_kept() -> None:
    env = make_env(SCENARIO, batch_size=2)
    with pytest.raises(InputError, match=r"^nothing to draw: call reset\(\) before render\(\)$"):
        env.render()
    env.reset()
    with pytest.raises(InputError, match=r"^row = 1: expected a row that is kept, 0 to 0$"):
        env.render(row=1)


@pytest.mark.parametrize("batch_size", [(), (2,)])
def test_torchrl_records_a_video(batch_size: tuple[int, ...], tmp_path: Path) -> None:
    env = make_env(SHORT, batch_size=batch_size, seed=0)
    env.append_transform(PixelRenderTransform())
    logger = CSVLogger("videos", str(tmp_path), video_format="pt")
    env.append_transform(VideoRecorder(logger, "flight", skip=1))
    flights = env.rollout(SHORT.num_slots)
    env.transform.dump()
    (film,) = tmp_path.rglob("*.pt")
    frames = torch.load(film)
    assert (frames.shape, frames.dtype) == ((1, 4, 3, 520, 760), torch.uint8)
    last = render_frame(SHORT, *path_of(flights, (0,) * len(batch_size)))
    np.testing.assert_array_equal(frames[0, -1].permute(1, 2, 0), last)
