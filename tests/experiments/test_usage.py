"""The help of each recipe."""

import shlex
import sys

import pytest

from hyuav import cli
from hyuav._support import program
from recipe_calls import Call


@pytest.fixture(params=[*cli.RECIPES, "benchmark"])
def screen(
    request: pytest.FixtureRequest,
    call: Call,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> tuple[str, str]:
    """A command and its help."""
    monkeypatch.setattr(program, "called", ["hyuav", request.param])
    call(request.param, "--help")
    return f"hyuav {request.param}", capsys.readouterr().out


def test_it_fits_a_screen_and_tells_where_the_rest_is(screen: tuple[str, str]) -> None:
    command, text = screen
    lines = text.splitlines()
    assert len(lines) <= 30
    assert max(map(len, lines)) <= 80
    assert f"{command} --cfg job: all that can be set" in text


def test_its_examples_are_calls_of_the_command(screen: tuple[str, str]) -> None:
    command, text = screen
    examples = [line for line in text.split("\n\n")[1].splitlines() if "pip" not in line]
    assert examples
    assert all(line.startswith(command) for line in examples)


def test_defaults_groups_and_sections_are_told(
    call: Call, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(program, "called", ["hyuav", "compare"])
    call("compare", "-h", "learners=3")
    told = capsys.readouterr().out
    assert {"num_slots=[10,20]", "without=[]", "output=runs/TIME_compare"} <= set(told.split())
    monkeypatch.setattr(program, "called", ["hyuav", "train"])
    call("train", "-h")
    told = capsys.readouterr().out
    members = "clusters, contested, disk, random_disk, random_layout, two_eavesdroppers"
    assert f"scenario=two_clusters or {members}" in " ".join(told.split())
    lines = [" ".join(line.split()) for line in told.splitlines()]
    assert "logger=wandb or none, tensorboard" in lines
    assert "logger library, mode, project, entity, group, job_type, name, tags, id" in lines


def test_a_script_is_told_as_it_was_called(call: Call, capsys: pytest.CaptureFixture[str]) -> None:
    call("train", "--help")  # which calls itself by the name alone
    told = capsys.readouterr().out
    assert f"{shlex.join([sys.orig_argv[0], 'train'])} resume=runs/NAME" in told
    assert "hyuav train" not in told


def test_all_that_can_be_set_is_told_on_request(
    call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    call("train", "--cfg", "job", "scheme=relay")
    told = capsys.readouterr().out.splitlines()
    assert {"scheme: relay", "  jamming_power: 0.08", "  num_episodes: 1000"} <= set(told)
