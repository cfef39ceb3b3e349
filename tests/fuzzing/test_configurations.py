"""Hostile configurations, options and command lines."""

import importlib
import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from benchmarks.plan import Benchmark
from hostile import (
    CASES,
    TRIED,
    anything,
    attempt,
    damaged,
    fuzz,
    numbers,
    require_one_line,
    scalars,
    texts,
)
from hyuav import Scenario
from hyuav._support.parameters import Parameters
from hyuav.experiments.comparison.plan import Compare
from hyuav.experiments.evaluation import EvaluationParameters
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import EvaluationLoggerParameters, LoggerParameters
from hyuav.learning.learners import Learner
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.training import TrainingParameters
from hyuav.viz.dashboard.serve import Dashboard
from recipe_calls import Call, Refusal

WHOLE = RunConfiguration(
    "custom",
    Scenario(ue_positions=((1.0, 2.0),), num_slots=2),
    (Learner(), Learner("relay", 1)),
    "ddpg",
    ALGORITHMS["ddpg"](hidden_sizes=(2,)),
    TrainingParameters(num_episodes=1, batch_size=1, replay_size=2, cohorts=1),
).to_dict()

SECTIONS = st.one_of(
    *(
        st.builds(lambda name, changed: {**WHOLE, name: changed}, st.just(name), damaged(section))
        for name, section in WHOLE.items()
        if isinstance(section, dict)
    ),
    st.lists(damaged(WHOLE["learners"][0]) | anything, max_size=3).map(
        lambda learners: {**WHOLE, "learners": learners}
    ),
    damaged(WHOLE, 1),
    st.sampled_from(sorted(ALGORITHMS)).flatmap(
        lambda name: damaged({"name": name, **ALGORITHMS[name]().to_dict()}).map(
            lambda changed: {**WHOLE, "algorithm": {"name": name, **changed}}
        )
    ),
)


def enough(kind: str) -> bool:
    return sum(TRIED[kind, outcome] for outcome in ("worked", "refused")) >= CASES[kind]


@pytest.mark.slow
def test_a_hostile_configuration_is_kept_as_it_is_or_refused(tmp_path: Path) -> None:
    kind = "configuration"
    path = tmp_path / "run"

    def keep(values: dict[str, Any]) -> RunConfiguration:
        configuration = RunConfiguration.from_dict(values)
        path.mkdir(exist_ok=True)
        (path / "config.yaml").unlink(missing_ok=True)
        run = RunDirectory.create(path, configuration)
        assert run.configuration() == configuration
        return configuration

    @fuzz(kind)
    @given(SECTIONS)
    def try_one(values: dict[str, Any]) -> None:
        attempt(kind, lambda: keep(values))

    try_one()
    assert enough(kind)


RECORDS: list[type[Parameters]] = [
    *ALGORITHMS.values(),
    *(Benchmark, Compare, Dashboard, EvaluationParameters, TrainingParameters),
    *(LoggerParameters, EvaluationLoggerParameters, Learner),
]


@pytest.mark.slow
def test_hostile_options_are_kept_as_they_are_or_refused() -> None:
    kind = "options"

    @fuzz(kind)
    @given(
        st.sampled_from(RECORDS).flatmap(
            lambda record: st.tuples(st.just(record), damaged(record().to_dict()))
        )
    )
    def try_one(options: tuple[type[Parameters], dict[str, Any]]) -> None:
        record, values = options
        made = attempt(kind, lambda: record.from_dict(values))
        if made is not None:
            assert record.from_dict(made.to_dict()) == made

    try_one()
    assert enough(kind)


TINY = [
    *("training.num_episodes=1", "training.batch_size=2", "training.evaluation_episodes=2"),
    *("training.replay_size=8", "algorithm.hidden_sizes=[2]", "logger.mode=disabled"),
    *("training.compile=never", "scenario.num_slots=2", "learners=1", "evaluation.episodes=2"),
]
KEYS = {
    "train": [
        *("scheme", "num_slots", "seed", "device", "warm_start", "resume", "learners"),
        *("scenario", "algorithm", "training.cohorts", "training.replay_size", "threads"),
        *(f"scenario.{name}" for name in Scenario.preset("two_clusters").to_dict()),
        *(f"algorithm.{name}" for name in ALGORITHMS["ddpg"]().to_dict()),
    ],
    "evaluate": ["run", "num_slots", "output", "device", "threads", "evaluation.resolution"],
    "report": ["run", "threads"],
    "draw": ["run", "figures"],
    "dashboard": ["port", "address", "runs", "open"],
}
words = st.text(max_size=12) | scalars.map(str) | numbers.map(repr) | texts


def end_in_one_line(module: Any, arguments: list[str]) -> bool:
    """Call a recipe; whether it was carried out. A refusal is one line and status 2."""
    out, err = io.StringIO(), io.StringIO()
    before = sys.argv
    sys.argv = [module.__name__, *arguments]
    try:
        with redirect_stdout(out), redirect_stderr(err):
            module.main()
        status = None
    except SystemExit as stopped:
        status = stopped.code
    finally:
        sys.argv = before
    if status in (0, None):
        return True
    assert status == 2, err.getvalue()
    assert err.getvalue().count("\n") == 1, err.getvalue()
    require_one_line(err.getvalue().rstrip("\n"))
    return False


@pytest.mark.slow
def test_a_hostile_command_line_is_carried_out_or_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    kind = "command line"
    recipes = Path(__file__).parents[2] / "recipes"
    monkeypatch.syspath_prepend(str(recipes))
    monkeypatch.chdir(tmp_path)
    modules = {name: importlib.import_module(name) for name in KEYS}
    overrides = st.sampled_from(sorted(KEYS)).flatmap(
        lambda name: st.tuples(
            st.just(name),
            st.lists(st.tuples(st.sampled_from(KEYS[name]), words), min_size=1, max_size=3),
        )
    )

    @fuzz(kind)
    @given(overrides)
    def try_one(command: tuple[str, list[tuple[str, str]]]) -> None:
        name, pairs = command
        own = [f"{key}={value}" for key, value in pairs if "\x00" not in value]
        tiny = [word for word in TINY if name == "train" and not word.startswith("evaluation.")]
        given_keys = {word.partition("=")[0] for word in own}
        tiny = [word for word in tiny if word.partition("=")[0] not in given_keys]
        if name == "dashboard":
            own.append("port=0")  # which is refused, so that nothing is served
        carried_out = end_in_one_line(modules[name], [*own, *tiny])
        TRIED[kind, "worked" if carried_out else "refused"] += 1

    try_one()
    assert enough(kind)


HUGE = [
    *("scenario.num_slots=1000000000000", "num_slots=1000000000000", "learners=1000000000"),
    *("training.replay_size=1000000000000000", "training.batch_size=1000000000000000"),
    *("algorithm.hidden_sizes=[1000000000]", "training.evaluation_episodes=1000000000000"),
    *("seed=100000000000000000000", "threads=1000000000000", "training.cohorts=1000000000000"),
    "algorithm.hidden_sizes=[16000,16000,16000,16000,16000,16000,16000,16000,16000]",
]


@pytest.mark.parametrize("argument", HUGE)
def test_a_huge_size_is_refused_before_memory_is_taken(
    call: Call, capsys: pytest.CaptureFixture[str], argument: str
) -> None:
    tiny = [word for word in TINY if word.partition("=")[0] != argument.partition("=")[0]]
    tiny = [word for word in tiny if not word.startswith("evaluation.")]
    if "batch_size" in argument:
        tiny = [word for word in tiny if "replay_size" not in word]
    with pytest.raises(SystemExit) as stopped:
        call("train", argument, *tiny)
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    "content",
    [
        "hydra: {callbacks: {x: {_target_: os.mkdir, path: hacked}}}\n",
        "# @package hydra.callbacks.x\n_target_: os.mkdir\npath: hacked\n",
        "defaults: [/hydra/callbacks@_global_: other]\nue_positions: [[1, 2]]\n",
        "name: ${oc.env:HOME}\nue_positions: [[1, 2]]\n",
        "name: !!python/object/apply:os.mkdir [hacked]\n",
        "name: &a [*a]\n",
        "[" * 1000,
    ],
)
@pytest.mark.parametrize("header", ["", "# @package _global_\n"])
def test_a_scenario_that_was_sent_gives_no_orders(
    call: Call, capsys: pytest.CaptureFixture[str], tmp_path: Path, header: str, content: str
) -> None:
    (tmp_path / "sent" / "scenario").mkdir(parents=True)
    (tmp_path / "sent" / "scenario" / "evil.yaml").write_text(header + content)
    with pytest.raises(SystemExit) as stopped:
        call("train", f"--config-dir={tmp_path / 'sent'}", "scenario=evil", "logger.mode=disabled")
    assert stopped.value.code == 2
    told = capsys.readouterr().err
    assert told.startswith("error: configuration file ")
    assert told.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["sent"]


def test_a_scenario_that_holds_values_alone_is_read(
    call: Call, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "sent" / "scenario").mkdir(parents=True)
    OmegaConf.save(
        {"ue_positions": [[1, 2]], "num_slots": 0}, tmp_path / "sent" / "scenario" / "own.yaml"
    )
    with pytest.raises(SystemExit):
        call("train", f"--config-dir={tmp_path / 'sent'}", "scenario=own", "logger.mode=disabled")
    assert "num_slots = 0: expected a whole number >= 1" in capsys.readouterr().err


def test_a_file_that_is_not_chosen_may_be_whatever_it_is(refusal: Refusal, tmp_path: Path) -> None:
    (tmp_path / "sent" / "scenario" / "far").mkdir(parents=True)
    (tmp_path / "sent" / "scenario" / "evil.yaml").write_text("hydra: {run: {dir: hacked}}\n")
    (tmp_path / "sent" / "scenario" / "far" / "own.yaml").write_text("ue_positions: 3\n")
    line = refusal("train", "-cd", f"{tmp_path / 'sent'}", "scenario=far/own")
    assert line.startswith("error: ue_positions = 3: expected at least one pair")
    line = refusal("train", f"--config-dir={tmp_path / 'sent'}", "scenario=glob(*)", "-m")
    assert line.startswith("error: configuration file ")


@pytest.mark.parametrize(
    "words",
    [
        ["--config-dir", "missing"],
        ["--config-path", "sent"],
        ["--config-p=sent"],
        ["hydra.searchpath=[file://sent]"],
        ["++hydra.searchpath=[file://sent]"],
        ["--config-dir"],
        ["--cfg", "all of it"],
    ],
)
def test_files_are_read_from_one_place_alone(refusal: Refusal, words: list[str]) -> None:
    assert refusal("train", *words).startswith("error: ")
