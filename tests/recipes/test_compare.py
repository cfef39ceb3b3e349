"""The comparison's recipe as a user calls it, at a size that is small enough for a test."""

import json
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from faults import leave_overflowing
from hyuav._support import machine
from hyuav.experiments.run_directory import RunDirectory
from hyuav.learning.guide.robust import RobustDDPG
from recipe_calls import TINY_COMPARISON, Call, Refusal

Printed = pytest.CaptureFixture[str]

TWO = ["algorithm=[ddpg,sac]", "scenario=two_clusters", "scheme=[hybrid,relay]", *TINY_COMPARISON]
ONE = ["algorithm=ddpg", *TWO[1:], "training.cohorts=1"]
SHARDS = {"ddpg_two_clusters_T8", "sac_two_clusters_T8"}


def test_a_comparison_trains_prints_keeps_and_draws(
    call: Call, once: Call, tmp_path: Path, capsys: Printed
) -> None:
    once("compare", *TWO)
    here, printed = tmp_path / "here", capsys.readouterr().out
    results = pd.read_parquet(here / "results.parquet")
    identity = ["algorithm", "scenario", "scheme", "num_slots", "seed"]
    assert results.columns[:5].tolist() == identity
    assert len(results.drop_duplicates(identity)) == 2 * 2 * 2
    np.testing.assert_allclose(results["fraction"], results["sum_rate"] / results["optimum"])
    assert len(pd.read_parquet(here / "curves.parquet")) == 8 * 2
    assert len(pd.read_parquet(here / "cells.parquet")) == 4
    summary = json.loads((here / "summary.json").read_text())
    assert [row["algorithm"] for row in summary["algorithms"]] == ["ddpg", "sac"]
    assert len(summary["improvements"]) == 2
    assert summary["layouts"] == []
    assert {path.name for path in (here / "figures").iterdir()} == {
        f"{name}.{kind}"
        for name in ("cells", "learning_curves", "performance_profiles", "improvement")
        for kind in ("png", "pdf", "csv")
    }
    assert {path.name for path in (here / "shards").iterdir()} == SHARDS
    assert not list(here.rglob("wandb"))
    table = [line for line in printed.splitlines() if not line.startswith("comparison:")]
    assert max(map(len, table)) <= 80
    assert "…" not in printed
    call(
        "evaluate",
        "run=here/shards/sac_two_clusters_T8",
        "evaluation.episodes=4",
        "evaluation.resolution=10",
    )
    evaluation = json.loads((here / "shards/sac_two_clusters_T8/evaluation.json").read_text())
    proposed = evaluation["schemes"]["proposed"]["secrecy_sum_rate"]["mean"]
    own = results[(results["algorithm"] == "sac") & (results["scheme"] == "hybrid")]
    assert proposed == pytest.approx(own["sum_rate"].mean(), rel=1e-5)


def test_only_what_is_missing_is_done_again(
    call: Call, once: Call, tmp_path: Path, capsys: Printed
) -> None:
    once("compare", *TWO)
    here, shards = tmp_path / "here", tmp_path / "here" / "shards"
    results = pd.read_parquet(here / "results.parquet").drop(columns="seconds")
    kept = [*(shards / "ddpg_two_clusters_T8").rglob("*"), *(here / "optima").iterdir()]
    written = [file.stat().st_mtime_ns for file in kept]
    broken = shards / "sac_two_clusters_T8.partial"
    (shards / "sac_two_clusters_T8").rename(broken)
    (broken / "results.parquet").unlink()
    capsys.readouterr()
    call("compare", *TWO)
    first = capsys.readouterr().out
    assert {path.name for path in shards.iterdir()} == SHARDS
    again = pd.read_parquet(here / "results.parquet").drop(columns="seconds")
    pd.testing.assert_frame_equal(again, results)
    kept += (shards / "sac_two_clusters_T8").rglob("*")
    written += [file.stat().st_mtime_ns for file in kept[len(written) :]]
    call("compare", *TWO, "training.cohorts=3", "workers=2")
    assert capsys.readouterr().out == first
    assert [file.stat().st_mtime_ns for file in kept] == written


def test_what_is_damaged_is_told_and_made_anew(
    call: Call, once: Call, tmp_path: Path, capsys: Printed
) -> None:
    once("compare", *TWO)
    here, before = tmp_path / "here", capsys.readouterr().out
    shard, optimum = here / "shards/sac_two_clusters_T8", here / "optima/two_clusters.parquet"
    for file in (shard / "curves.parquet", optimum):
        file.write_bytes(file.read_bytes()[:100])
    call("compare", *TWO)
    again = capsys.readouterr()
    assert again.out == before
    assert again.err.splitlines() == [
        f"{damaged}: damaged or incomplete, and made anew" for damaged in (optimum, shard)
    ]


def test_a_shard_that_fails_is_named_and_tried_again(
    call: Call, tmp_path: Path, capsys: Printed
) -> None:
    in_the_way = tmp_path / "here" / "shards" / "ddpg_two_clusters_T8.partial"
    in_the_way.parent.mkdir(parents=True)
    in_the_way.write_text("")
    with pytest.raises(SystemExit) as stopped:
        call("compare", *TWO)
    assert stopped.value.code == 1
    printed = capsys.readouterr()
    (line,) = printed.err.splitlines()
    assert line.startswith("failed: ddpg_two_clusters_T8: NotADirectoryError: ")
    assert "SAC" in printed.out
    results = pd.read_parquet(tmp_path / "here" / "results.parquet")
    assert set(results["algorithm"]) == {"sac"}
    in_the_way.unlink()
    call("compare", *TWO)
    results = pd.read_parquet(tmp_path / "here" / "results.parquet")
    assert set(results["algorithm"]) == {"ddpg", "sac"}


@pytest.mark.parametrize(("flown", "learners"), [(0, range(4)), (2, [3])])
def test_learners_that_stop_are_named_with_what_their_last_good_weights_earn(
    call: Call, once: Call, tmp_path: Path, capsys: Printed, flown: int, learners: Sequence[int]
) -> None:
    shard = tmp_path / "here" / "shards" / "ddpg_two_clusters_T8"
    once("compare", *ONE)
    configuration = RunDirectory(shard).configuration()
    shutil.rmtree(shard)
    leave_overflowing(shard.with_name(f"{shard.name}.partial"), configuration, flown, learners)
    capsys.readouterr()
    call("compare", *ONE)
    printed = capsys.readouterr()
    lines = [line for line in printed.out.splitlines() if "stopped in episode" in line]
    results = pd.read_parquet(tmp_path / "here" / "results.parquet")
    assert len(lines) == len(learners) == results["stopped"].notna().sum()
    for line, learner in zip(lines, learners, strict=True):
        own = results.iloc[learner]
        assert line.startswith(f"DDPG, two_clusters, T = 8, {own['scheme']}, seed {own['seed']} ")
        assert line.endswith(f" count: {100 * own['fraction']:.1f} % of the optimum")
    assert len(printed.err.splitlines()) == len(learners)
    call("compare", *ONE)
    assert capsys.readouterr().out == printed.out


def test_shards_of_random_layouts_and_of_a_peer_train_in_processes(
    call: Call, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("stable_baselines3")
    entries = ["algorithm=[td3,stable_baselines3]", "scheme=jamming", "scenario=[]", "layouts=2"]
    call("compare", *entries, *TINY_COMPARISON, "learners=1", "workers=2")
    here = tmp_path / "here"
    layouts = [f"layout-{seed}" for seed in (1000, 1001)]
    configurations = [
        RunDirectory(here / "shards" / f"td3_{layout}_T8").configuration() for layout in layouts
    ]
    assert [own.scenario_name for own in configurations] == layouts
    assert configurations[0].training.cohorts == 1
    results = pd.read_parquet(here / "results.parquet")
    assert results["scenario"].tolist() == layouts * 2
    cells = pd.read_parquet(here / "cells.parquet")
    assert cells["learners"].tolist() == [2, 2]
    summary = json.loads((here / "summary.json").read_text())
    assert [row["learners"] for row in summary["layouts"]] == [2, 2]
    printed = capfd.readouterr()
    assert "SB3 DDPG" in printed.out
    assert "torchrl" not in printed.out + printed.err


def test_the_generalist_is_there_before_the_first_episode(
    call: Call, tmp_path: Path, capsys: Printed
) -> None:
    entries = ["algorithm=[generalist]", "scenario=two_clusters", "scheme=[hybrid,relay]"]
    call("compare", *entries, *TINY_COMPARISON)
    results = pd.read_parquet(tmp_path / "here" / "results.parquet")
    assert set(results["algorithm"]) == {"generalist"}
    assert (results["episodes_to_threshold"] == 0).all()
    assert results["fraction"].min() > 0.97
    assert results["stopped"].isna().all()
    assert results.groupby("scheme")["earned"].nunique().eq(1).all()  # it depends on no seed
    curves = pd.read_parquet(tmp_path / "here" / "curves.parquet")
    assert sorted(set(curves["episode"])) == [0, 4]
    assert "Generalist" in capsys.readouterr().out
    assert (tmp_path / "here" / "report.html").is_file()


def test_a_variant_is_compared_without_its_pieces(
    call: Call, tmp_path: Path, capsys: Printed
) -> None:
    pieces = ["algorithm=[ddpg,ddpg_robust]", "without=[clock,repeat_every]"]
    call(
        "compare", *pieces, *TINY_COMPARISON, "scenario=two_clusters", "scheme=relay", "learners=1"
    )
    here = tmp_path / "here"
    entries = ["ddpg", "ddpg_robust", "ddpg_robust-clock", "ddpg_robust-repeat_every"]
    assert pd.read_parquet(here / "results.parquet")["algorithm"].tolist() == entries
    run = RunDirectory(here / "shards" / "ddpg_robust-clock_two_clusters_T8")
    assert run.configuration().algorithm == RobustDDPG(clock=False)
    printed = capsys.readouterr().out
    assert "without clock" in printed
    assert "without repeat every" in printed


def test_a_directory_of_another_comparison_is_left_alone(refusal: Refusal, tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "config.yaml").write_text("threshold: 0.5\n")
    line = "here': expected a comparison with algorithm = ['ddpg', 'sac']"
    assert line in refusal("compare", *TWO)
    assert [path.name for path in (tmp_path / "here").iterdir()] == ["config.yaml"]


REFUSALS = [
    (["algorithm=ppo"], "algorithm = 'ppo': expected one of ddpg, td3, sac"),
    (["algorithm=[ddpg,dpg]"], "algorithm[1] = 'dpg': expected one of ddpg, td3, sac"),
    (["algorithm=[sac,sac]"], "algorithm = ['sac', 'sac']: expected values that differ"),
    (["without=tau"], "without = 'tau': expected one of actor_learning_rate, "),
    (
        ["algorithm=[ddpg_robust,td3_robust]", "without=[clock]"],
        "without = ['clock']: expected one variant at a time, not ddpg_robust, td3_robust",
    ),
    (["without=[clock,clock]"], "without = ['clock', 'clock']: expected values that differ"),
    (["scenario=square"], "scenario = 'square': expected one of random_disk, two_clusters"),
    (["scenario=[]"], "scenario = []: expected at least one scenario, or layouts >= 1"),
    (["scenario=[disk,{layout:disk}]"], "scenario = ['disk-0', 'disk-0']: expected names that"),
    (["scenario=[{layout:disk,num_ues:0}]"], "num_ues = 0: expected a whole number >= 1"),
    (["scenario=[{layout:disk,name:../x}]"], "scenario name = '../x': expected letters, digits"),
    (["scenario=[{layout:disk,name:layout-x}]"], "scenario name = 'layout-x': expected letters"),
    (["layouts=-1"], "layouts = -1: expected a whole number >= 0"),
    (["scheme=both"], "scheme = 'both': expected one of hybrid, relay, jamming"),
    (["num_slots=[10,0]"], "num_slots[1] = 0: expected a whole number >= 1"),
    (["learners=0"], "learners = 0: expected a whole number >= 1"),
    (["shard_learners=0"], "shard_learners = 0: expected a whole number >= 1"),
    (["engine=slurm"], "engine = 'slurm': expected one of processes, ray"),
    (["retries=-1"], "retries = -1: expected a whole number >= 0"),
    (["workers=0"], "workers = 0: expected a whole number >= 1"),
    (["threshold=97"], "threshold = 97: expected a number in [0, 1]"),
    (["treshold=1"], "configuration: unknown field 'treshold': did you mean 'threshold'"),
    (["training.num_episodes=0"], "num_episodes = 0: expected a whole number >= 1"),
    (["training.evaluation_episodes=1"], "evaluation_episodes = 1: expected a whole number >= 2"),
    (["evaluation.resolution=1e-9"], "resolution = 1e-09: expected a number of metres"),
    (["logger.mode=on"], "mode = 'on': expected one of offline, online, disabled"),
]


@pytest.mark.parametrize(("arguments", "line"), REFUSALS, ids=[a[0] for a, _ in REFUSALS])
def test_a_mistake_is_answered_by_one_line_and_status_2(
    refusal: Refusal, tmp_path: Path, arguments: list[str], line: str
) -> None:
    assert line in refusal("compare", *arguments)
    assert not list(tmp_path.glob("runs/*"))


def test_a_missing_library_is_named_with_the_way_to_get_it(
    refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "_can_be_found", lambda _: False)
    line = "error: stable_baselines3 cannot be imported: pip install 'hyuav[bench]'\n"
    assert refusal("compare", "algorithm=[ddpg,stable_baselines3]", *TINY_COMPARISON) == line


def test_ray_is_asked_for_with_its_extra(refusal: Refusal, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    line = "error: ray cannot be imported: pip install 'hyuav[cluster]'\n"
    assert refusal("compare", "engine=ray", *TINY_COMPARISON) == line


def test_an_older_comparison_is_taken_up_and_its_shards_may_not_be_cut_anew(
    call: Call, once: Call, refusal: Refusal, tmp_path: Path
) -> None:
    once("compare", *ONE)
    config = tmp_path / "here" / "config.yaml"
    lines = config.read_text().splitlines(keepends=True)
    added = ("shard_learners:", "engine:", "address:", "retries:")
    unknown = (*added, "    coverage_blur:")
    config.write_text("".join(line for line in lines if not line.startswith(unknown)))
    shards = {path.name for path in (tmp_path / "here" / "shards").iterdir()}
    call("compare", *ONE, "retries=0")
    assert {path.name for path in (tmp_path / "here" / "shards").iterdir()} == shards
    line = "expected a comparison with shard_learners = 3 (there it is 60)"
    assert line in refusal("compare", *ONE, "shard_learners=3")


def test_learners_that_do_not_fit_one_worker_are_shared(call: Call, tmp_path: Path) -> None:
    one = [*TINY_COMPARISON, "algorithm=ddpg", "scenario=two_clusters", "scheme=[hybrid,relay]"]
    call("compare", *one, "shard_learners=3")
    here = tmp_path / "here"
    names = {f"ddpg_two_clusters_T8_{part}" for part in ("0-1", "2-3")}
    assert {path.name for path in (here / "shards").iterdir()} == names
    results = pd.read_parquet(here / "results.parquet")
    found = list(zip(results["scheme"], results["seed"], strict=True))
    assert found == [(scheme, seed) for scheme in ("hybrid", "relay") for seed in (0, 1)]
