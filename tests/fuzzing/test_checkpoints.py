"""Hostile checkpoints: loaded as finite numbers or refused in one line, and never run."""

import copy
import dataclasses
import io
import math
import os
import pickle
import shutil
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from torch import Tensor

from hostile import CASES, TRIED, anything, attempt, fuzz, mutated, texts
from hyuav import InputError, Scenario
from hyuav._support.errors import Halted
from hyuav.experiments.initial_weights import saved_weights
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters
from hyuav.experiments.train import resume, train
from hyuav.learning.checkpoint import FORMAT, load_checkpoint, save_checkpoint
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.parameters import Guide
from hyuav.learning.guide.robust import RobustSAC
from hyuav.learning.learners import Learner
from hyuav.learning.policy import learned_policy
from hyuav.learning.training import Training, TrainingParameters

SCENARIO = Scenario(ue_positions=((1.0, 2.0), (-3.0, 4.0)), num_slots=2)
ALGORITHM = DDPG(hidden_sizes=(2,))
PARAMETERS = TrainingParameters(num_episodes=1, batch_size=1, replay_size=4, compile="never")


def training() -> Training:
    return Training(SCENARIO, [Learner("hybrid"), Learner("relay")], ALGORITHM, PARAMETERS)


WEIGHTS = training().best_weights
STATE = training().state_dict()


def saved(content: Any, kind: str) -> bytes:
    file = io.BytesIO()
    torch.save({"format": FORMAT, "kind": kind, "content": content}, file)
    return file.getvalue()


class Payload:
    """Unpickling this makes a directory."""

    def __init__(self, function: str, target: str) -> None:
        self.function, self.target = function, target

    def __reduce__(self) -> tuple[Any, ...]:
        if self.function == "eval":
            return eval, (f"__import__('os').mkdir({self.target!r})",)
        return getattr(os, self.function), (
            self.target if self.function == "mkdir" else f"mkdir {self.target}",
        )


def payloads(target: str) -> list[bytes]:
    """Pickles that act on being read: alone, in a checkpoint, and in every protocol."""
    hostile = [Payload(function, target) for function in ("mkdir", "system", "eval")]
    bare = [pickle.dumps(each, protocol) for each in hostile for protocol in range(6)]
    nested = [saved({"weight": each}, "weights") for each in hostile]
    legacy = io.BytesIO()
    torch.save(
        {"format": FORMAT, "kind": "weights", "content": hostile[0]},
        legacy,
        _use_new_zipfile_serialization=False,
    )
    return [*bare, *nested, legacy.getvalue()]


def fly(path: Path) -> None:
    """What a recipe does with weights, and what comes of it is finite."""
    policy = learned_policy(SCENARIO, ALGORITHM, saved_weights(path), [0, 1])
    observed = torch.zeros(2, 3, SCENARIO.num_ues + 5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from tensordict import TensorDict

        acted = policy(TensorDict(observation=observed, batch_size=(2, 3)))
    assert acted["action"].isfinite().all()


@pytest.mark.slow
def test_the_bytes_of_a_checkpoint_are_weights_or_refused(tmp_path: Path) -> None:
    kind, path, target = "checkpoint, bytes", tmp_path / "best.pt", str(tmp_path / "hacked")
    whole = saved(WEIGHTS, "weights")
    acting = payloads(target)

    @fuzz(kind)
    @given(
        mutated(whole)
        | st.sampled_from(acting)
        | st.sampled_from(acting).flatmap(mutated)
        | st.binary(max_size=200)
    )
    def try_one(content: bytes) -> None:
        path.write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            attempt(kind, lambda: fly(path))

    try_one()
    assert not Path(target).exists()
    assert sum(TRIED[kind, outcome] for outcome in ("worked", "refused")) >= CASES[kind]


def test_each_payload_acts_where_it_is_trusted_and_not_here(tmp_path: Path) -> None:
    target, path = tmp_path / "hacked", tmp_path / "best.pt"
    for content in payloads(str(target)):
        path.write_bytes(content)
        for load in (saved_weights, lambda own: load_checkpoint(own, "training")):
            with pytest.raises(InputError, match=r"^checkpoint = [^\n]*$"):
                load(path)
        assert not target.exists()
        torch.load(path, weights_only=False) if content[:2] == b"PK" else pickle.loads(content)
        if target.exists():
            target.rmdir()


tensors = st.sampled_from(
    [
        *(torch.zeros(2, 7, 2), torch.ones(1, 1), torch.zeros(0, 3), torch.zeros(2, 0, 2)),
        *(torch.tensor(1.0), torch.full((2, 7, 2), torch.nan), torch.full((2, 7, 2), torch.inf)),
        *(torch.zeros(2, 7, 2, dtype=torch.int64), torch.zeros(2, 7, 2, dtype=torch.float64)),
        *(torch.zeros(2, 7, 2, dtype=torch.complex64), torch.full((2, 7, 2), 1e38)),
        *(torch.zeros(1).expand(10**6, 10**6, 10**3), torch.zeros(2, 7, 2).to_sparse()),
        *(torch.zeros(2, 7, 2, dtype=torch.bfloat16), torch.zeros(2, 7, 2, device="meta")),
        torch.quantize_per_tensor(torch.zeros(2, 7, 2), 0.1, 0, torch.qint8),
    ]
)
weights = st.dictionaries(
    st.sampled_from(sorted(WEIGHTS)) | texts, tensors | anything, max_size=3
).map(lambda changed: {**WEIGHTS, **changed})
states = st.dictionaries(
    st.sampled_from(sorted(STATE["cohorts"][0])) | texts, tensors | anything, max_size=2
).map(
    lambda changed: {
        **STATE,
        "cohorts": [{**STATE["cohorts"][0], **changed}, *STATE["cohorts"][1:]],
    }
)


@pytest.mark.slow
def test_the_content_of_a_checkpoint_is_used_or_refused(tmp_path: Path) -> None:
    kind, path = "checkpoint, content", tmp_path / "any.pt"

    @fuzz(kind)
    @given(st.booleans(), weights | tensors | anything, states | weights | anything)
    def try_one(of_weights: bool, own: Any, state: Any) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if of_weights:
                path.write_bytes(saved(own, "weights"))
                attempt(kind, lambda: fly(path))
            else:
                path.write_bytes(saved(state, "training"))
                attempt(kind, lambda: training().load_state_dict(load_checkpoint(path, "training")))

    try_one()
    assert sum(TRIED[kind, outcome] for outcome in ("worked", "refused")) >= CASES[kind]


SMALL = Guide(warm_up_episodes=1, update_every=2, repeat_every=2, imagined_flights=2)

RESUMED = RunConfiguration(
    "custom",
    SCENARIO,
    (Learner("hybrid"), Learner("relay")),
    "sac_robust",
    RobustSAC(hidden_sizes=(2,), guide=SMALL),
    dataclasses.replace(
        PARAMETERS, num_episodes=2, evaluation_every=1, evaluation_episodes=1, cohorts=1
    ),
)
OFF, SILENT = LoggerParameters(mode="disabled"), Console(file=io.StringIO())


@pytest.fixture(scope="module")
def two_of_three(tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    """A run that has an episode left to fly."""
    run = train(tmp_path_factory.mktemp("fuzzed") / "run", RESUMED, OFF, SILENT)
    config = run.config_file.read_text()
    run.config_file.write_text(config.replace("num_episodes: 2", "num_episodes: 3"))
    return run


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths to everything within nested values, but to the whole."""
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    found = []
    for key, own in entries:
        found.append((*path, key))
        if isinstance(own, dict | list | tuple):
            found += places(own, (*path, key))
    return found


def changed(value: Any, path: tuple[Any, ...], change: Callable[[Any], Any]) -> Any:
    """Nested values of which one is another, or is left out."""
    if not path:
        return change(value)
    kept = list(value) if isinstance(value, tuple) else copy.copy(value)  # and what it is marked by
    kept[path[0]] = changed(value[path[0]], path[1:], change)
    if kept[path[0]] is LEFT_OUT:
        del kept[path[0]]
    return tuple(kept) if isinstance(value, tuple) else kept


def near(value: Any, how: int) -> Any:
    """A value of the same kind that may be out of range, or of a shape that may not fit."""
    if isinstance(value, Tensor):
        ways = (
            *(lambda: torch.full_like(value, 3), lambda: torch.zeros_like(value)),
            *(lambda: -value.float() - 1, lambda: value.float() * torch.nan),
            *(lambda: value.float() * 1e38, lambda: value[..., :1], lambda: value.double()),
            *(lambda: value.flatten(), lambda: value.unsqueeze(0), lambda: value.to_sparse()),
            *(lambda: torch.zeros(1, dtype=value.dtype).expand(value.shape), lambda: 1.0),
            lambda: (value + 2**62) if value.dtype == torch.int64 else value.float() / 0.0,
        )
        return ways[how % len(ways)]()
    if isinstance(value, int | float):
        return (value + 1, value - 1, -value, value + 2**40, value + 0.5, 2**62)[how % 6]
    return [value] if how % 2 else LEFT_OUT


LEFT_OUT = object()


@pytest.mark.slow
def test_a_training_goes_on_from_a_changed_checkpoint_or_refuses_it(
    two_of_three: RunDirectory, tmp_path: Path
) -> None:
    kind, path = "checkpoint, resumed", tmp_path / "run"
    content = load_checkpoint(two_of_three.last_checkpoint, "training")
    others = (tensors | anything).map(lambda new: lambda _: new)
    changes = st.integers(0, 100).map(lambda how: lambda value: near(value, how)) | others

    def go_on(run: RunDirectory) -> None:
        try:
            resume(run.path, OFF, SILENT)
        except Halted as error:  # its weights are no longer finite
            raise InputError(str(error)) from None
        cells = [line.split(",") for line in run.metrics_file.read_text().splitlines()]
        numbers = [cell for row in cells[1:] for cell in (*row[:3], *row[4:]) if cell]
        assert all(math.isfinite(float(cell)) for cell in numbers)
        assert run.best_weights()
        assert load_checkpoint(run.last_checkpoint, "training")

    @fuzz(kind)
    @given(st.sampled_from(places(content)), changes)
    def try_one(place: tuple[Any, ...], change: Callable[[Any], Any]) -> None:
        shutil.rmtree(path, ignore_errors=True)
        run = RunDirectory(shutil.copytree(two_of_three.path, path))
        run.previous_checkpoint.unlink()
        run.last_checkpoint.write_bytes(saved(changed(content, place, change), "training"))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            attempt(kind, lambda: go_on(run))

    try_one()
    assert sum(TRIED[kind, outcome] for outcome in ("worked", "refused")) >= CASES[kind]


def test_an_archive_that_claims_to_be_huge_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "best.pt"
    save_checkpoint(path, "weights", {"weight": torch.zeros(2, 2)})
    with zipfile.ZipFile(path) as whole, zipfile.ZipFile(tmp_path / "bomb.pt", "w") as bomb:
        for name in whole.namelist():
            content = whole.read(name)
            if "/data/" in name:
                content = bytes(2**26)
            bomb.writestr(name, content, zipfile.ZIP_DEFLATED)
    assert (tmp_path / "bomb.pt").stat().st_size < 2**20
    with pytest.raises(InputError, match=r"^checkpoint = [^\n]*$"):
        saved_weights(tmp_path / "bomb.pt")
