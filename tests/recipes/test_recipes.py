"""The recipes as a user calls them, on a problem small enough for a test."""

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from omegaconf import OmegaConf

from hyuav import Scenario, clusters
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.schemes import GENERALISTS, LABELS
from hyuav.learning.ddpg import DDPG
from recipe_calls import FEW, SHORT, Call, Refusal

NAMES = "ddpg, ddpg_robust, maddpg, sac, sac_robust, td3, td3_robust"
RECIPES = Path(__file__).parents[2] / "recipes"


def test_training_keeps_a_run(call: Call, tmp_path: Path) -> None:
    call("train", "scheme=relay", "algorithm=td3", "learners=2", "seed=4", *SHORT)
    (run,) = (tmp_path / "runs").iterdir()
    assert {path.name for path in run.iterdir()} >= {"config.yaml", "metrics.csv", "checkpoints"}
    config = (run / "config.yaml").read_text()
    assert "actor_every: 2" in config
    assert "num_slots: 10" in config
    metrics = pd.read_csv(run / "metrics.csv")
    assert metrics["episode"].max() == 4
    assert metrics["learner"].unique().tolist() == [0, 1]


def test_schemes_horizons_and_seeds_train_as_one_run(call: Call, tmp_path: Path) -> None:
    call("train", "scheme=[hybrid,jamming]", "num_slots=[3,6]", "learners=2", "seed=5", *SHORT)
    (run,) = (tmp_path / "runs").iterdir()
    learners = RunDirectory(run).configuration().learners
    expected = [(s, t, n) for s in ("hybrid", "jamming") for t in (3, 6) for n in (5, 6)]
    assert [(own.scheme, own.num_slots, own.seed) for own in learners] == expected
    last = RunDirectory(run).metrics().tail(8)
    assert list(zip(last["scheme"], last["num_slots"], last["seed"], strict=True)) == expected
    assert (last["slots"] == 4 * last["num_slots"]).all()
    assert last["best_evaluation"].notna().all()
    call("evaluate", f"run={run}", "num_slots=6", *FEW)
    summary = json.loads((run / "evaluation.json").read_text())
    assert summary["num_slots"] == 6
    assert summary["schemes"]["ja_ot"]["learners"] == 2
    assert "re_ot" not in summary["schemes"]


@pytest.mark.parametrize("algorithm", ["ddpg", "td3", "sac"])
def test_one_word_swaps_the_algorithm(call: Call, tmp_path: Path, algorithm: str) -> None:
    call("train", f"algorithm={algorithm}", *SHORT)
    (run,) = (tmp_path / "runs").iterdir()
    assert f"name: {algorithm}" in (run / "config.yaml").read_text()


def test_a_saved_scenario_is_chosen_by_the_name_of_its_file(call: Call, tmp_path: Path) -> None:
    (tmp_path / "mine" / "scenario").mkdir(parents=True)
    campus = Scenario(ue_positions=((5.0, 6.0), (-7.0, 8.0)), jamming_power=0.5)
    campus.save(tmp_path / "mine" / "scenario" / "campus.yaml")
    call("train", f"--config-dir={tmp_path / 'mine'}", "scenario=campus", *SHORT)
    (run,) = (tmp_path / "runs").iterdir()
    configuration = RunDirectory(run).configuration()
    assert configuration.scenario_name == "campus"
    assert configuration.scenario == dataclasses.replace(campus, num_slots=10)


def test_a_layout_is_drawn_by_words_and_kept_with_the_run(call: Call, tmp_path: Path) -> None:
    words = ("scenario.num_ues=12", "scenario.num_clusters=3", "scenario.seed=3")
    again = ("train", "scenario=clusters", *words, "scenario.jamming_power=0.2", *SHORT)
    call(*again, "hydra.run.dir=runs/one")
    run = RunDirectory(tmp_path / "runs" / "one")
    drawn = Scenario(ue_positions=clusters([4, 4, 4], seed=3), num_slots=10, jamming_power=0.2)
    assert run.configuration().scenario == drawn
    assert run.configuration().scenario_name == "clusters-3"
    assert len(run.request()["scenario"]["ue_positions"]) == 12
    before = run.metrics_file.read_bytes()
    call(*again, "hydra.run.dir=runs/one")  # which is finished
    assert run.metrics_file.read_bytes() == before


def test_a_sweep_keeps_a_run_for_each_job(call: Call, tmp_path: Path) -> None:
    call("train", "--multirun", "seed=3,4", "hydra.sweep.dir=sweep", *SHORT)
    runs = [RunDirectory(run).configuration() for run in (tmp_path / "sweep").glob("*/")]
    assert {run.learners[0].seed for run in runs} == {3, 4}


def test_a_run_remembers_all_that_was_asked_for(once: Call, tmp_path: Path) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    config = (tmp_path / "run" / "config.yaml").read_text()
    assert "threads: 1" in config
    assert "mode: disabled" in config


def test_an_evaluation_needs_a_place_to_write_to(
    once: Call, refusal: Refusal, tmp_path: Path
) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    (tmp_path / "file").write_text("")
    assert "output = 'file" in refusal("evaluate", "run=run", "output=file")


def test_runs_that_cannot_be_evaluated_leave_nothing_behind(
    once: Call, refusal: Refusal, tmp_path: Path
) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    (tmp_path / "loop").symlink_to("loop")
    assert "run = 'loop': expected a run directory" in refusal("evaluate", "run=[run,loop]")
    (tmp_path / "run" / "checkpoints" / "best.pt").unlink()
    assert "best.pt" in refusal("evaluate", "run=run", "output=other")
    assert not (tmp_path / "other").exists()


def test_a_training_goes_on_as_it_was_configured(
    call: Call, refusal: Refusal, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call("train", *SHORT, "learners=2", "hydra.run.dir=begun")
    metrics = (tmp_path / "begun" / "metrics.csv").read_bytes()
    capsys.readouterr()
    call("train", "resume=begun", "logger.name=later")  # which has nothing left to do
    assert "run: begun" in capsys.readouterr().out
    assert (tmp_path / "begun" / "metrics.csv").read_bytes() == metrics
    assert "not seed" in refusal("train", "resume=begun", "seed=1")


def test_the_same_call_goes_on_and_says_so(
    call: Call, refusal: Refusal, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shorter, whole = ("train", "hydra.run.dir=run", *SHORT), tmp_path / "whole" / "metrics.csv"
    longer = (*shorter, "training.num_episodes=6")
    call(*longer, "hydra.run.dir=whole")
    call(*shorter)
    config = tmp_path / "run" / "config.yaml"  # of a training of 6 episodes, of which 4 are flown
    config.write_text(config.read_text().replace("num_episodes: 4", "num_episodes: 6"))
    capsys.readouterr()
    call(*longer, "logger.name=later", "threads=2")
    assert "run: this training goes on after episode 4 of 6\n" in capsys.readouterr().out
    own, unbroken = (pd.read_csv(file) for file in (tmp_path / "run" / "metrics.csv", whole))
    pd.testing.assert_frame_equal(own.drop(columns="seconds"), unbroken.drop(columns="seconds"))
    call(*longer)
    assert "run: this training is finished\n" in capsys.readouterr().out
    for other in ("seed=1", "warm_start=whole"):
        assert "expected one without a run in it" in refusal(*longer, other)
    assert pd.read_csv(tmp_path / "run" / "metrics.csv").equals(own)


def test_training_starts_from_another_runs_weights(call: Call, once: Call, tmp_path: Path) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    call("train", "warm_start=run", "learners=2", "hydra.run.dir=second", *SHORT)
    first = pd.read_csv(tmp_path / "run" / "metrics.csv")["best_evaluation"].max()
    second = pd.read_csv(tmp_path / "second" / "metrics.csv")["best_evaluation"]
    assert second.dropna().min() >= first - 1e-4


def test_saved_runs_are_evaluated_offline(
    call: Call, once: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    (tmp_path / "run").rename(tmp_path / "hybrid")
    for scheme in ("relay", "jamming"):
        call("train", f"scheme={scheme}", f"hydra.run.dir={scheme}", *SHORT)
    few = ["evaluation.episodes=5", "evaluation.resolution=10"]
    call("evaluate", "run=[hybrid,relay,jamming]", "output=together", *few)
    summary = json.loads((tmp_path / "together" / "evaluation.json").read_text())
    assert set(summary["schemes"]) == {
        *("proposed", "re_ot", "ja_ot", "re_lt", "ja_lt", "no_helper"),
        *("optimum", "re_optimum", "ja_optimum", "optimum_power"),
    }
    assert (tmp_path / "together" / "flights.parquet").exists()
    drawn = {path.name for path in (tmp_path / "together" / "figures").iterdir()}
    assert drawn == {f"flight_map{end}" for end in (".pdf", ".png", ".csv", "_nodes.csv")}
    call("evaluate", "run=hybrid", *few)
    assert json.loads((tmp_path / "hybrid" / "evaluation.json").read_text())["episodes"] == 5
    printed = capsys.readouterr().out
    assert "Ja-LT" in printed
    table = [line for line in printed.splitlines() if not line.startswith(("run:", "evaluation:"))]
    assert max(map(len, table)) <= 80


def test_the_main_job_trains_evaluates_and_draws(call: Call, tmp_path: Path) -> None:
    call(
        "reproduce",
        "candidates=2",
        "candidate_episodes=2",
        *FEW,
        "hydra.run.dir=job",
        *SHORT,
    )
    summary = json.loads((tmp_path / "job" / "evaluation.json").read_text())
    assert {*LABELS} - {"proposed_power", *GENERALISTS.values()} <= set(summary["schemes"])
    assert {"proposed", "proposed_paper", "re_ot_paper", "ja_ot_paper"} <= set(summary["schemes"])
    paper = RunDirectory(tmp_path / "job" / "as_in_paper").configuration()
    assert paper.algorithm == DDPG()
    assert RunDirectory(tmp_path / "job").configuration().algorithm_name == "ddpg_robust"
    figures = {path.stem for path in (tmp_path / "job" / "figures").glob("*.pdf")}
    assert figures == {
        *("learning_curves", "trajectories", "flight_map"),
        *("sum_rate_maps", "energy", "offloading"),
    }


def test_a_straight_flight_too_fast_for_the_horizon_is_left_out_and_named(
    call: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call("train", "hydra.run.dir=short", *SHORT, "scenario.num_slots=5")
    call("evaluate", "run=short", *FEW)
    summary = json.loads((tmp_path / "short" / "evaluation.json").read_text())
    assert "ja_lt" not in summary["schemes"]
    assert "Ja-LT is left out" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["[/]", "[red]a  b"])
def test_a_path_is_printed_as_it_is(
    call: Call, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    call("train", f'hydra.run.dir="{name}"', *SHORT)
    assert f"/{name}\n" in capsys.readouterr().out
    call("evaluate", f'run="{name}"', *FEW)
    assert f"evaluation: {name}\n" in capsys.readouterr().out
    call("draw", f'run="{name}"', "figures=learning_curves")
    assert f"figures: {name}/figures\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "shown"), [("[/]", "[/]"), ("\x1b[2J\x1b]0;hacked\n", "?[2J?]0;hacked?")]
)
def test_a_scenarios_name_is_printed_as_text_that_no_terminal_obeys(
    call: Call,
    once: Call,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    name: str,
    shown: str,
) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    capsys.readouterr()
    config = tmp_path / "run" / "config.yaml"
    OmegaConf.update(content := OmegaConf.load(config), "scenario.name", name)
    OmegaConf.save(content, config)
    call("evaluate", "run=run", *FEW)
    printed = capsys.readouterr().out
    assert printed.strip().startswith(f"{shown}, T = 10: mean of 4 episodes")
    assert all(line.isprintable() for line in printed.splitlines())


NAMED = ("train", "compare", "evaluate", "reproduce", "report", "draw", "dashboard", "benchmark")
SECTIONS = {
    "train": ("training",),
    "compare": ("training", "evaluation"),
    "evaluate": ("evaluation",),
    "reproduce": ("training", "evaluation"),
}
ENTRIES = {
    "train": ("training",),
    "compare": ("learners", "algorithm"),
    "reproduce": ("seeds",),
    "benchmark": ("parts",),
}

REFUSALS = [
    (
        ["train", "algorithm=ppo"],
        f"algorithm = 'ppo': expected one of {NAMES}",
    ),
    (["train", "scenario=square"], "scenario = 'square': expected one of"),
    (["train", "scenario.ue_powr=1"], "scenario: unknown field 'ue_powr': did you mean 'ue_power'"),
    (["train", "learner=3"], "configuration: unknown field 'learner': did you mean 'learners'"),
    (["train", "scenario.ue_power=-1"], "ue_power = -1: expected a number in [0, 1e+06]"),
    (["train", "scenario.ue_power=high"], "ue_power = 'high': expected a number in [0, 1e+06]"),
    (["train", "scenario.num_slots=0"], "num_slots = 0: expected a whole number >= 1"),
    (["train", "scheme=both"], "scheme = 'both': expected one of hybrid, relay, jamming"),
    (["train", "seed=-3"], "seed = -3: expected a whole number >= 0"),
    (["train", "num_slots=[10,0]"], "num_slots[1] = 0: expected a whole number >= 1"),
    (["train", "scheme=[relay,relay]"], "expected learners that differ"),
    (["train", "seed="], "seed = '': expected a whole number >= 0"),
    (["train", "algorithm.discount=1.5"], "discount = 1.5: expected a number in [0, 1]"),
    (["train", "training.num_episodes=1.5"], "num_episodes = 1.5: expected a whole number >= 1"),
    (["train", "logger.mode=on"], "mode = 'on': expected one of offline, online, disabled"),
    (["train", "logger=tensorbord"], "did you mean 'tensorboard'"),
    (["compare", "logger=3"], "Config group override must be a string"),
    (["train", "~logger"], "~logger = '': expected one of none, tensorboard, wandb"),
    (["evaluate", "~logger"], "expected one of as_trained, none, tensorboard, wandb"),
    (["train", "logger=as_trained"], "expected one of none, tensorboard, wandb"),
    (["train", "device=tpu9"], "device = 'tpu9': expected a device of this machine"),
    (["train", "warm_start=nowhere.pt"], "checkpoint = 'nowhere.pt': expected a checkpoint"),
    (["train", "scenario.ue_positions=[[1,2]"], "no viable alternative at input"),
    (["train", "=3"], "'=3': expected NAME=VALUE"),
    (["train", "--foo"], "unrecognized arguments: --foo"),
    (["train", "hydra.run.dir=/proc/nowhere"], "No such file or directory: '/proc/nowhere'"),
    (["train", "algorithm.actor_learning_rate=9"], "expected a number in [0, 1]"),
    (["reproduce", "evaluation.resolution=1e-9"], "resolution = 1e-09: expected a number"),
    (["evaluate"], "run is missing: expected run=DIRECTORY"),
    (["evaluate", "run=nowhere"], "run = 'nowhere': expected a run directory"),
    (["reproduce", "evaluation.episodes=1"], "episodes = 1: expected a whole number >= 2"),
    (["train", "scenario.num_slots=???"], "scenario.num_slots = '???': expected a value"),
    (["train", "logger.mode=${nope}"], "Interpolation key 'nope' not found"),
    (["train", "+schem=relay"], "configuration: unknown field 'schem': did you mean 'scheme'?"),
    (
        ["train", "algorithm.hidden_sizes.x.y=3"],
        "algorithm.hidden_sizes has no fields: set algorithm",
    ),
    (["train", "algorithm=[ddpg,td3]"], f"algorithm = '[ddpg,td3]': expected one of {NAMES}"),
    (["reproduce", "algorithm=[ddpg,td3]"], f"algorithm = '[ddpg,td3]': expected one of {NAMES}"),
    (
        ["train", "~scenario"],
        "~scenario = '': expected one of clusters, contested, disk, random_disk",
    ),
    (["train", "scenario=disk", "scenario.num_ues=0"], "num_ues = 0: expected a whole number >= 1"),
    (["train", "scenario=disk", "scenario.radius=101"], "radius = 101.0: expected center + radius"),
    (["train", "scenario=disk", "scenario.seed=-1"], "seed = -1: expected a whole number >= 0"),
    (["train", "scenario=disk", "scenario.num_clusters=2"], "unknown field 'num_clusters'"),
    (["reproduce", "scenario=clusters", "scenario.num_clusters=11"], "expected at most num_ues"),
    (["benchmark", "scenario=disk", "scenario.center=3"], "center = 3: expected two coordinates"),
    (["train", f"scheme={'[' * 300}{']' * 300}"], "the command line is nested too deep"),
    (["report", "-m", "run=a,b"], "-m: this recipe does a single job: leave it out"),
    (["train", "num_slots.x=3"], "'num_slots.x=3': num_slots has no fields: set num_slots=..."),
    (
        ["compare", "algorithm.clock=1"],
        "'algorithm.clock=1': algorithm has no fields: set algorithm=",
    ),
    (["compare", "algorithm.x.y=1"], "'algorithm.x.y=1': algorithm has no fields: set"),
    (["train", "resume=base", "hydra.run.dir=base"], "not hydra.run.dir"),
    (["train", "resume=base", "hydra.run.dir=."], "not hydra.run.dir"),
    *(([recipe, "+foo=1"], "configuration: unknown field 'foo': one of ") for recipe in NAMED),
    *(
        ([recipe, f"{section}={value}"], f"{section} = {shown}: expected names with values")
        for recipe, sections in SECTIONS.items()
        for section in sections
        for value, shown in (("null", None), (3, 3))
    ),
    *(
        ([recipe, f"~{name}"], f"configuration: {name} is missing")
        for recipe, names in ENTRIES.items()
        for name in names
    ),
]


@pytest.mark.parametrize(("command", "line"), REFUSALS, ids=[" ".join(c) for c, _ in REFUSALS])
def test_a_mistake_is_answered_by_one_line_and_status_2(
    refusal: Refusal, tmp_path: Path, command: list[str], line: str
) -> None:
    assert line in refusal(*command)
    assert not list(tmp_path.glob("runs/*"))


@pytest.mark.parametrize("field", ["num_slots", "name"])
def test_a_saved_scenario_that_leaves_a_value_open_is_refused(
    refusal: Refusal, tmp_path: Path, field: str
) -> None:
    (tmp_path / "sent" / "scenario").mkdir(parents=True)
    content = f"ue_positions: [[1, 2]]\n{field}: ???\n"
    (tmp_path / "sent" / "scenario" / "open.yaml").write_text(content)
    line = refusal("train", f"--config-dir={tmp_path / 'sent'}", "scenario=open")
    assert line == f"error: scenario.{field} = '???': expected a value\n"


def test_going_on_into_the_runs_own_directory_is_refused_and_loses_nothing(
    once: Call, refusal: Refusal, tmp_path: Path
) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    (tmp_path / "run").rename(tmp_path / "base")
    before = sorted((tmp_path / "base").rglob("*"))
    accepted = "device=, threads=, logger.NAME= and training.num_episodes=, not hydra.run.dir"
    hint = '(warm_start="base" begins a new training with its weights)'
    line = refusal("train", "resume=base", "hydra.run.dir=base")
    assert line == f"error: resume = 'base': expected nothing beside it but {accepted} {hint}\n"
    assert sorted((tmp_path / "base").rglob("*")) == before


def test_a_finished_training_goes_on_for_more_episodes(
    call: Call, once: Call, refusal: Refusal, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    capsys.readouterr()
    call("train", "resume=run", "training.num_episodes=6")
    assert "run: this training goes on after episode 4 of 6\n" in capsys.readouterr().out
    run = RunDirectory(tmp_path / "run")
    assert run.metrics()["episode"].tolist() == [1, 2, 3, 4, 5, 6]
    assert run.configuration().training.num_episodes == 6
    accepted = "expected at least the 6 episodes that are trained already"
    line = refusal("train", "resume=run", "training.num_episodes=5")
    assert line == f"error: num_episodes = 5: {accepted}\n"
    line = refusal("train", "resume=run", "training.num_episodes=8", "training.batch_size=4")
    assert "not training.batch_size (warm_start=" in line


def test_a_mistake_on_the_command_line_ends_the_process_with_status_2(tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, RECIPES / "train.py", "algorithm=ppo"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 2
    assert ended.stderr == f"error: algorithm = 'ppo': expected one of {NAMES}\n"
