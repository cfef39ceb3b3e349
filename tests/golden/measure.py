"""The numbers of the whole program on this CPU, bit for bit, to be compared with golden.json.

Each part is measured, and its numbers are kept, by its name (in seconds of one core)::

    python tests/golden/measure.py rewards             #   5: one slot, all over the map
    python tests/golden/measure.py rollouts            #   5: all that environments tell
    python tests/golden/measure.py trainings           #  35: every algorithm, slot by slot
    python tests/golden/measure.py optima              #  10: the best flights
    python tests/golden/measure.py compiled_trainings  # 120
    python tests/golden/measure.py job                 #  20: the main job, as small as can be

``pytest tests/golden`` compares the first parts with what was kept, ``pytest -m slow tests/golden``
the last two. Kept are SHA-256 digests of the bytes of tensors, whatever axes of length 1 they
have, and numbers in full precision. Parts and functions of the program are looked up when they
are needed, so that one that is missing fails its own part alone.
"""

import dataclasses
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

import hyuav

GOLDEN = Path(__file__).with_name("golden.json")
ROOT = Path(__file__).parents[2]
PRESETS = ("two_clusters", "random_disk")
MODES = ("hybrid", "relay", "jamming")
BATCH, SLOTS = 8, 20

ROBUST: dict[str, Any] = {"guide": {"warm_up_episodes": 6}}
"""So that everything that begins after the warm-up acts in a short training."""

ALGORITHMS: dict[str, tuple[str, dict[str, Any]]] = {
    "ddpg": ("DDPG", {}),
    "td3": ("TD3", {}),
    "sac": ("SAC", {}),
    "ddpg_robust": ("RobustDDPG", ROBUST),
    "td3_robust": ("RobustTD3", ROBUST),
    "sac_robust": ("RobustSAC", ROBUST),
}

SHORT: dict[str, Any] = {
    "num_episodes": 20,
    "replay_size": 500,
    "batch_size": 16,
    "evaluation_every": 5,
    "evaluation_episodes": 8,
    "cohorts": 1,
}

JOB = (
    *("training.num_episodes=8", "training.batch_size=8", "training.evaluation_every=2"),
    *("training.evaluation_episodes=3", "training.compile=never", "training.cohorts=1"),
    *("algorithm.hidden_sizes=[8]", "algorithm.guide.warm_up_episodes=2", "logger.mode=disabled"),
    *("candidates=2", "candidate_episodes=3", "evaluation.episodes=4", "evaluation.resolution=5"),
    *("scenario.num_slots=8", "figures=[learning_curves]", "hydra.run.dir=job"),
)


def digest(values: Tensor) -> str:
    """Of the bytes of a tensor, in the order of its elements, whatever its shape."""
    content = values.detach().cpu().contiguous().numpy().tobytes()
    return hashlib.sha256(content).hexdigest()[:16]


def numbers(values: Tensor) -> str:
    """The elements, each in the fewest digits that tell it from all others of its type."""
    return " ".join(str(value) for value in values.detach().cpu().flatten().numpy())


def arithmetic() -> str:
    """Differs where another CPU or another PyTorch rounds otherwise."""
    torch.set_num_threads(1)
    generator = torch.Generator().manual_seed(0)
    values = torch.rand(3, 65, 97, generator=generator) + 0.1
    products = torch.cat([values @ values.mT, values.exp() @ values.tanh().mT])
    sums = torch.cat([values.log2().sum(dim=-1), values.sqrt().mean(dim=-1)])
    normals = torch.randn(999, generator=generator)
    return digest(torch.cat([products.flatten(), sums.flatten(), normals]))


def scenario(preset: str, **changes: Any) -> Any:
    """A preset with other values of some parameters."""
    return dataclasses.replace(hyuav.Scenario.preset(preset), **changes)


def rewards() -> dict[str, Any]:
    """Of one slot of hovering at places all over the map."""
    places = torch.cartesian_prod(*[torch.linspace(-100.0, 100.0, 26)] * 2)
    measured: dict[str, Any] = {}
    for preset, fading in product(PRESETS, (False, True)):
        flown = scenario(preset, fading=fading)
        env = hyuav.make_env(flown, "hybrid", (len(places),), None, 5, True)
        start = places.reshape(env.observation_spec["position"].shape)
        state = env.reset(TensorDict({"position": start}, batch_size=env.batch_size))
        state["action"] = env.action_spec.zero()
        slot = env.step(state)["next"]
        found = {name: slot["diagnostics", f"{name}_sum_rate"] for name in ("relay", "jamming")}
        found["reward"] = slot["reward"]
        measured[f"{preset}, fading {fading}"] = {
            name: {
                "digest": digest(values),
                "largest": numbers(values.max()),
                "at (4, 4) m": numbers(values.flatten()[26 * 13 + 13]),
            }
            for name, values in found.items()
        }
    return measured


VARIANTS: dict[str, tuple[dict[str, Any], Sequence[str] | str, Any, dict[str, Any]]] = {
    **{
        f"{mode}, fading {fading}": ({"fading": fading}, mode, 7, {"fading": True})
        for mode, fading in product(MODES, (False, True))
    },
    "clock and geofence": ({}, "hybrid", 7, {"clock": True, "geofence": True, "fading": True}),
    "seeds of rows": (
        {},
        [*MODES, *MODES, "hybrid", "relay"],
        [3, 1, 4, 1, 5, 9, 2, 6],
        {"clock": True, "fading": True},
    ),
    "budgets": (
        {"edge_energy_budget": 3.0, "helper_energy_budget": 900.0, "speed_limit": "disc"},
        *("hybrid", 7, {"fading": True}),
    ),
}
"""By name: changes of the scenario, who chooses the mode, seeds, options of the environment."""


def actions() -> Tensor:
    """Of all slots (T, batch, 2): to all sides, over the edges of the map and beyond [-1, 1]."""
    drift = torch.linspace(-torch.pi, torch.pi, BATCH + 1)[1:]
    drift = 0.7 * torch.stack([drift.cos(), drift.sin()], dim=-1)
    generator = torch.Generator().manual_seed(11)
    return drift + 0.6 * torch.randn(SLOTS, BATCH, 2, generator=generator)


def rollouts() -> dict[str, Any]:
    """Digests of everything that an environment tells of a flight, by entry."""
    measured: dict[str, Any] = {}
    for name, (changes, mode, seed, options) in VARIANTS.items():
        flown = scenario("two_clusters", num_slots=SLOTS, **changes)
        env = hyuav.make_env(flown, mode, (BATCH,), None, seed, True, **options)
        state = env.reset()
        after = [state.clone()]
        for action in actions():
            state["action"] = action.reshape(env.action_spec.shape)
            after.append(env.step(state)["next"])
            state = env.step_mdp(state)
        measured[name] = {
            "first": dict(entries(after[0], flown.num_ues)),
            "slots": dict(entries(torch.stack(after[1:]), flown.num_ues)),
            "returns": numbers(after[-1]["episode_reward"]),
        }
    return measured


def entries(told: TensorDictBase, num_ues: int) -> Iterator[tuple[str, str]]:
    """Digests by name, also of the parts of what is told of links and distances in one row."""
    named = dict(told.flatten_keys(".").items())
    for name, values in sorted(named.items()):
        yield name, digest(values)
    ends = ("legitimate", "eavesdropper")
    links = ("ue_legitimate", "ue_helper", "ue_eavesdropper", *(f"helper_{end}" for end in ends))
    for whole, parts in (("distances", ("ue", *ends)), ("fading", links)):
        if whole in named:
            sizes = [num_ues if part.startswith("ue") else 1 for part in parts]
            columns = named[whole].split(sizes, dim=-1)
            for part, values in zip(parts, columns, strict=True):
                yield f"{whole}.{part}", digest(values)


def trainings() -> dict[str, Any]:
    """Short trainings of every algorithm, slot by slot."""
    measured = {name: training(name, "never") for name in ALGORITHMS}
    return measured | {"no fading": training("ddpg_robust", "never", fading=False)}


def compiled_trainings() -> dict[str, Any]:
    """Short trainings of some algorithms by compiled programs."""
    return {name: training(name, "always") for name in ("ddpg", "ddpg_robust", "sac")}


def training(name: str, compilation: str, **changes: Any) -> dict[str, Any]:
    """What a training of three learners reports, and the weights that it ends with."""
    cls, options = ALGORITHMS[name]
    trained = hyuav.Training(
        scenario("two_clusters", num_slots=10, **changes),
        [hyuav.Learner(mode, seed) for seed, mode in enumerate(MODES)],
        getattr(hyuav, cls)(hidden_sizes=(48, 20), **options),
        hyuav.TrainingParameters(**SHORT, compile=compilation),
    )
    episodes = list(trained.episodes())
    return {
        "rewards": [numbers(episode.accumulated_reward) for episode in episodes],
        "losses": {
            step: [numbers(episode.losses[step]) for episode in episodes]
            for step in episodes[0].losses
        },
        "evaluations": [list(map(numbers, episode.evaluation or ())) for episode in episodes],
        "best evaluation": numbers(trained.best_evaluation),
        "best weights": sorted(map(digest, trained.best_weights.values())),
        "state": {path: digest(values) for path, values in leaves(trained.state_dict())},
    }


def leaves(state: Any, path: str = "") -> Iterator[tuple[str, Tensor]]:
    """The tensors of nested dicts and lists, by where they are."""
    if isinstance(state, Tensor):
        yield path, state
    elif isinstance(state, Mapping | TensorDictBase):
        for name, value in state.items():
            yield from leaves(value, f"{path}.{name}")
    elif isinstance(state, list | tuple):
        for index, value in enumerate(state):
            yield from leaves(value, f"{path}.{index}")


def optima() -> dict[str, Any]:
    """Values and flights of the optima."""
    from hyuav.references.optimum import solve_horizons

    measured: dict[str, Any] = {}
    for preset, (fading, spacing) in product(PRESETS, ((False, 1.0), (True, 4.0))):
        found = solve_horizons(scenario(preset, fading=fading), (10, 20), MODES, resolution=spacing)
        measured[f"{preset}, fading {fading}, {spacing} m"] = {
            f"{mode}, T = {num_slots}": {
                "value": repr(optimum.value),
                "standard error": repr(optimum.standard_error),
                "path": digest(optimum.path),
                "modes": numbers(optimum.modes),
            }
            for mode, horizons in found.items()
            for num_slots, optimum in horizons.items()
        }
    return measured


def job() -> dict[str, Any]:
    """What the main job, as small as can be, finds."""
    with TemporaryDirectory() as directory:
        subprocess.run(
            [sys.executable, ROOT / "recipes" / "reproduce.py", *JOB],
            cwd=directory,
            env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
            stdout=subprocess.DEVNULL,
            check=True,
        )
        summary = json.loads((Path(directory) / "job" / "evaluation.json").read_text())
    return {"schemes": summary["schemes"]}


PARTS: dict[str, Callable[[], dict[str, Any]]] = {
    part.__name__: part for part in (rewards, rollouts, trainings, optima, compiled_trainings, job)
}


def measure(name: str) -> Any:
    """The numbers of a part, as JSON keeps them."""
    torch.set_num_threads(1)
    return json.loads(json.dumps(PARTS[name]()))


def main(names: Sequence[str]) -> None:
    """Measure parts and keep their numbers."""
    golden = json.loads(GOLDEN.read_text()) if GOLDEN.exists() else {}
    golden["arithmetic"] = arithmetic()
    for name in names or PARTS:
        golden[name] = measure(name)
        if name.endswith("trainings"):
            for measured in golden[name].values():  # of the state, what is learned
                state = measured["state"].items()
                measured["state"] = {path: own for path, own in state if ".modules." in path}
        GOLDEN.write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
