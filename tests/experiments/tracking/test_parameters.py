import sys

import pytest

from hyuav import InputError
from hyuav.experiments.tracking import EvaluationLoggerParameters, LoggerParameters


def test_an_unknown_logger_mode_is_refused() -> None:
    with pytest.raises(InputError, match="mode = 'on': expected one of offline, online, disabled"):
        LoggerParameters(mode="on")


def test_nothing_need_be_set() -> None:
    assert LoggerParameters().mode == "offline"
    assert LoggerParameters().tags == ()
    assert EvaluationLoggerParameters().mode == "as_trained"


def test_one_tag_or_several_are_kept_as_a_tuple() -> None:
    assert LoggerParameters.from_dict({"tags": "paper"}).tags == ("paper",)
    assert LoggerParameters.from_dict({"tags": ["paper", "robust"]}).tags == ("paper", "robust")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("project", "a/b"),
        ("project", ""),
        ("project", "x" * 129),
        ("entity", 3),
        ("entity", "who?"),
        ("group", "x" * 129),
        ("job_type", " "),
        ("name", ["a"]),
        ("tags", ["x" * 65]),
        ("tags", [1]),
        ("tags", {"a": 1}),
        ("id", "a;b"),
        ("id", "a:b"),
    ],
)
def test_what_weights_and_biases_would_refuse_is_refused_beforehand(
    field: str, value: object
) -> None:
    with pytest.raises(InputError, match=rf"^{field}(\[0\])? = [^\n]*: expected [^\n]*text[^\n]*$"):
        LoggerParameters.from_dict({field: value})


@pytest.mark.parametrize(
    ("word", "mode"), [("disabled", "disabled"), ("online", "online"), ("dryrun", "offline")]
)
def test_the_mode_of_the_environment_counts_where_none_is_given(
    monkeypatch: pytest.MonkeyPatch, word: str, mode: str
) -> None:
    monkeypatch.setenv("WANDB_MODE", word)
    assert LoggerParameters().mode == EvaluationLoggerParameters().mode == mode
    assert LoggerParameters(mode="offline").mode == "offline"


def test_a_mode_of_the_environment_that_there_is_not_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("WANDB_MODE", "on")
    with pytest.raises(InputError, match="mode = 'on': expected one of offline, online, disabled"):
        LoggerParameters()
    assert LoggerParameters(mode="offline").mode == "offline"


def test_tensorboard_is_asked_for_by_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tensorboard", None)  # as if it were not installed
    line = r"^tensorboard cannot be imported: pip install 'hyuav\[tensorboard\]'$"
    with pytest.raises(InputError, match=line):
        LoggerParameters(library="tensorboard")
    assert LoggerParameters().library == "wandb"
