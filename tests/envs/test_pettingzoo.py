"""Each helper as an agent of PettingZoo's parallel API."""

import dataclasses
import functools
import subprocess
import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from pettingzoo.test import parallel_api_test, parallel_seed_test
from torchrl.envs import PettingZooWrapper
from torchrl.envs.utils import check_env_specs

from hyuav import InputError, InputTypeError, Scenario, make_env
from hyuav.envs import pettingzoo

parallel_env: Any = pettingzoo.parallel_env

TWO = dataclasses.replace(
    Scenario.preset("two_clusters"),
    helper_starts=((-60.0, -60.0), (60.0, -60.0)),
    eavesdropper_positions=((80.0, 80.0), (-80.0, 60.0)),
    num_slots=5,
)
POWER = dataclasses.replace(TWO, power_control=True)
NAMES = ["helper_0", "helper_1"]


def actions(env: Any) -> dict[str, Any]:
    return {name: env.action_space(name).sample() for name in env.agents}


@pytest.mark.parametrize("options", [{}, {"clock": True, "geofence": True, "diagnostics": True}])
@pytest.mark.parametrize("scenario", [TWO, POWER], ids=["nominal", "power"])
def test_pettingzoo_finds_no_fault(scenario: Scenario, options: dict[str, Any]) -> None:
    make = functools.partial(parallel_env, scenario, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(make(), num_cycles=12)
        parallel_seed_test(make, num_cycles=12)


def test_agents_fly_as_the_grouped_environment_does() -> None:
    env, grouped = parallel_env(TWO, diagnostics=True), make_env(TWO, agents=True)
    observations, infos = env.reset(seed=4)
    grouped.set_seed(4, static_seed=True)
    state = grouped.reset()
    for slot in range(TWO.num_slots):
        own = state["helpers", "observation"].numpy()
        np.testing.assert_array_equal(np.stack([observations[name] for name in NAMES]), own)
        np.testing.assert_array_equal(env.state(), state["observation"].numpy())
        for index, name in enumerate(NAMES):
            assert env.observation_space(name).contains(observations[name])
            np.testing.assert_array_equal(infos[name]["position"], state["position"][index])
            assert infos[name]["mode"] == state["mode"][index]
        chosen = actions(env)
        observations, rewards, terminations, truncations, infos = env.step(chosen)
        state["helpers", "action"] = np.stack([chosen[name] for name in NAMES])
        state = grouped.step(state)["next"]
        assert rewards == dict.fromkeys(NAMES, float(state["helpers", "reward"][0]))
        assert terminations == dict.fromkeys(NAMES, False)
        assert truncations == dict.fromkeys(NAMES, slot == TWO.num_slots - 1)
        assert infos["helper_0"]["diagnostics"]["helper_energy"].shape == (2,)
    assert env.agents == []
    with pytest.raises(ResetNeeded, match="after an episode's end"):
        env.step(dict.fromkeys(NAMES, np.zeros(2)))


def test_a_lone_agent_flies_as_gymnasium_does() -> None:
    own, other = parallel_env(), gymnasium.make("hyuav/SecureOffloading-v0")
    observations, infos = own.reset(seed=1, options={"position": (5.0, 6.0)})
    observation, info = other.reset(seed=1, options={"position": (5.0, 6.0)})
    np.testing.assert_array_equal(observations["helper_0"], observation)
    for _ in range(3):
        np.testing.assert_array_equal(infos["helper_0"].pop("position"), info.pop("position"))
        assert infos["helper_0"] == info
        action = np.array([0.4, -0.2], np.float32)
        observations, rewards, *_, infos = own.step({"helper_0": action})
        observation, reward, *_, info = other.step(action)
        np.testing.assert_array_equal(observations["helper_0"], observation)
        assert rewards == {"helper_0": reward}
    assert own.observation_space("helper_0") == other.observation_space
    assert own.action_space("helper_0") == other.action_space


def test_torchrl_wraps_it() -> None:
    env = PettingZooWrapper(parallel_env(TWO), return_state=True)
    check_env_specs(env, seed=0)
    assert env.rollout(3)["next", "helper", "reward"].shape == (3, 2, 1)


def test_a_picture_is_drawn_where_it_is_asked_for() -> None:
    env = parallel_env(TWO, render_mode="rgb_array", max_episode_steps=2)
    env.reset(seed=0)
    first = env.render()
    env.step(actions(env))
    picture = env.render()
    assert picture.shape[-1] == 3
    assert picture.dtype == np.uint8
    assert not np.array_equal(picture, first)
    assert env.step(actions(env))[3] == dict.fromkeys(NAMES, True)
    assert parallel_env(TWO).render() is None


@pytest.mark.parametrize(
    ("given", "error", "line"),
    [
        ({"helper_0": [0.0, 0.0]}, InputError, r"actions = \['helper_0'\]: expected an action for"),
        ([0.0, 0.0], InputTypeError, r"actions = \[0.0, 0.0\]: expected an action for each of"),
        (
            {"helper_0": [0.0], "helper_1": [0.0, 0.0, 0.0]},
            InputError,
            r"actions\[helper_0\] = \[0.0\]: expected finite numbers of shape \(2,\)",
        ),
    ],
)
def test_other_actions_are_refused(given: Any, error: type[Exception], line: str) -> None:
    env = parallel_env(TWO)
    env.reset(seed=0)
    with pytest.raises(error, match=f"^{line}"):
        env.step(given)


def test_what_the_environment_sets_itself_is_no_option() -> None:
    for name in ("batch_size", "agents"):
        with pytest.raises(InputError, match=f"^option = '{name}': expected one of"):
            parallel_env(TWO, **{name: 1})


def test_without_pettingzoo_one_line_tells_how_to_get_it() -> None:
    program = "import sys; sys.modules['pettingzoo'] = None; import hyuav.envs.pettingzoo"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    line = "pettingzoo cannot be imported: pip install 'hyuav[multiagent]'"
    assert ran.stderr.splitlines()[-1].endswith(line)
