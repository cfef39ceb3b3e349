"""What the environment takes and gives: shapes, types, batches, and refused arguments."""

from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torchrl.collectors import Collector
from torchrl.envs.utils import check_env_specs

from hyuav import InputError, InputTypeError, Scenario, SecureOffloadingEnv
from hyuav.physics.modes import MODE_RULES
from reference import changed, fly, place, start_at

TWO_CLUSTERS = Scenario.preset("two_clusters")
RANDOM_DISK = Scenario.preset("random_disk")
BATCH_SIZES = [(), (1,), (3,), (2, 3)]


@pytest.mark.parametrize("batch_size", BATCH_SIZES)
@pytest.mark.parametrize("scheme", MODE_RULES)
@pytest.mark.parametrize("diagnostics", [False, True])
def test_the_specs_hold(batch_size: tuple[int, ...], scheme: str, diagnostics: bool) -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, scheme, batch_size, seed=0, diagnostics=diagnostics)
    check_env_specs(env)
    assert env.batch_size == batch_size
    episode = env.rollout(4)
    assert episode.batch_size == (*batch_size, 4)
    assert ("diagnostics" in set(episode.keys())) == diagnostics


def test_entries_have_the_documented_shapes_and_types() -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, batch_size=(2, 3), seed=0, diagnostics=True)
    after = env.rollout(2)["next"]
    documented = {
        "position": ((1, 2), torch.float32),
        "mode": (1, torch.int64),
        "distances": ((1, 12), torch.float32),
        "off_map": (1, torch.bool),
        "reward": (1, torch.float32),
        "done": (1, torch.bool),
        "terminated": (1, torch.bool),
        ("diagnostics", "offloading"): (10, torch.bool),
        ("diagnostics", "secrecy_rate"): (10, torch.float32),
        ("diagnostics", "relay_sum_rate"): (1, torch.float32),
        ("diagnostics", "jamming_sum_rate"): (1, torch.float32),
        ("diagnostics", "ue_energy"): (10, torch.float32),
        ("diagnostics", "edge_load"): (1, torch.float32),
        ("diagnostics", "edge_energy"): (1, torch.float32),
        ("diagnostics", "helper_energy"): (1, torch.float32),
        ("diagnostics", "budget_violation"): (1, torch.int64),
    }
    assert set(after.keys(True, True)) == set(documented)
    for key, (size, dtype) in documented.items():
        shape = size if isinstance(size, tuple) else (size,)
        assert after[key].shape == (2, 3, 2, *shape), key
        assert after[key].dtype == dtype, key


def test_no_slot_ends_the_episode() -> None:
    episode = SecureOffloadingEnv(TWO_CLUSTERS, batch_size=2, seed=0).rollout(100)
    assert episode.batch_size == (2, 100)
    assert not episode["next", "done"].any()
    assert not episode["next", "terminated"].any()


def test_a_double_precision_action_does_not_change_the_types() -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, batch_size=2, seed=0, diagnostics=True)
    state = env.reset(
        TensorDict({"position": torch.zeros(2, 1, 2, dtype=torch.float64)}, batch_size=2)
    )
    assert place(state).dtype == torch.float32
    assert state["distances"].dtype == torch.float32
    episode = env.rollout(20)
    floats = [value.dtype for value in episode.values(True, True) if value.dtype.is_floating_point]
    assert set(floats) == {torch.float32}


def test_a_collector_works_unchanged() -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, batch_size=3, seed=0)
    collector = Collector(env, None, frames_per_batch=30, total_frames=60)
    batches = list(collector)
    collector.shutdown()
    assert [batch.batch_size for batch in batches] == [(3, 10)] * 2
    # The second batch continues where the first ended.
    torch.testing.assert_close(batches[0]["next", "position"][:, -1], batches[1]["position"][:, 0])


@pytest.mark.parametrize(
    "changes",
    [
        {"ue_positions": [(5.0, 5.0)] * 10},
        {"ue_positions": [(0.0, 0.0)]},
        {"ue_positions": [(i / 25, -i / 50) for i in range(1000)]},
        {"eavesdropper_positions": (0.0, 0.0)},
        {"eavesdropper_positions": (0.0, 0.0), "eavesdropper_altitude": 80.0},
        {"ue_power": 0.0, "jamming_power": 0.0, "relay_power": 0.0},
        {"task_size": (2e5, 2e5), "cycles_per_bit": (1e3, 1e3)},
        {"task_size": (0.0, 0.0)},
        {"ue_energy_budget": 0.0, "edge_energy_budget": 0.0, "helper_energy_budget": 0.0},
        {"helper_starts": (0.0, 0.0)},
        {"num_slots": 1},
    ],
)
def test_degenerate_worlds_give_finite_numbers(changes: dict[str, Any]) -> None:
    env = SecureOffloadingEnv(
        changed(RANDOM_DISK, **changes), MODE_RULES, 3, seed=0, diagnostics=True
    )
    state = start_at(env, [[0.0, 0.0]] * 3)  # exactly above L
    for action in ([0.0, 0.0], [1.0, 1.0]):
        state = fly(env, state, action)
        for key, value in state.items(True, True):
            assert bool(value.isfinite().all()), key


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"scenario": "two_cluster"}, InputError, "scenario = 'two_cluster'.*did you mean"),
        ({"scenario": 3}, InputTypeError, "scenario = 3"),
        ({"scheme": "relaying"}, InputError, "scheme = 'relaying'.*did you mean 'relay'"),
        ({"scheme": 3}, InputTypeError, "scheme = 3"),
        ({"scheme": ["relay"], "batch_size": 2}, InputError, "scheme = .*each of 2 rows"),
        ({"scheme": ["relay"]}, InputError, r"scheme = \['relay'\]"),
        ({"scheme": ["relay", "no"], "batch_size": 2}, InputError, r"scheme\[1\] = 'no'"),
        ({"batch_size": 0}, InputError, "batch_size = 0"),
        ({"batch_size": (2, -1)}, InputError, r"batch_size = \(2, -1\)"),
        ({"batch_size": True}, InputTypeError, "batch_size = True"),
        ({"batch_size": 2.0}, InputTypeError, "batch_size = 2.0"),
        ({"batch_size": "2"}, InputTypeError, "batch_size = '2'"),
        ({"device": "gpu"}, InputError, "device = 'gpu'"),
        ({"scenario": []}, InputError, "scenario = '0 scenarios'.*each of several rows"),
        ({"scenario": [[1.0, 2.0]] * 2 + ["x"]}, InputTypeError, r"ue_positions\[2\] = 'x'"),
        (
            {"scenario": [TWO_CLUSTERS] * 3, "batch_size": 2},
            InputError,
            "scenario = '3 scenarios': expected one scenario, or one for each of 2 rows",
        ),
        (
            {"scenario": [TWO_CLUSTERS, changed(TWO_CLUSTERS, num_slots=3)], "batch_size": 2},
            InputError,
            r"scenario\[1\].num_slots = 3: expected num_slots as of scenario\[0\]: rows differ",
        ),
        (
            {
                "scenario": [TWO_CLUSTERS, changed(TWO_CLUSTERS, ue_positions=[(0.0, 0.0)])],
                "batch_size": 2,
            },
            InputError,
            r"scenario\[1\].ue_positions = .*rows differ in positions only",
        ),
        ({"scenario": ["disk"] * 2, "batch_size": 2}, InputError, "scenario = 'disk'"),
        ({"scenario": [3] * 2, "batch_size": 2}, InputTypeError, "scenario = 3"),
        ({"seed": -1}, InputError, "seed = -1"),
        ({"seed": 2**63}, InputError, "seed = 9223372036854775808"),
        ({"seed": 1.5}, InputTypeError, "seed = 1.5"),
        ({"seed": "1"}, InputTypeError, "seed = '1'"),
        ({"seed": True}, InputTypeError, "seed = True"),
        ({"seed": np.array([1, 2])}, InputError, r"seed = \(1, 2\): expected one number, or one"),
        ({"seed": torch.tensor(1.5)}, InputTypeError, "seed = "),
    ],
)
def test_bad_arguments_are_answered_in_one_line(
    arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=f"^{message}") as caught:
        SecureOffloadingEnv(**{"scenario": TWO_CLUSTERS, **arguments})
    assert "\n" not in str(caught.value)
