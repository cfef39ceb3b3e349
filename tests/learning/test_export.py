import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from hyuav import InputError, Policy, Scenario
from hyuav.learning.policy import learned_policy
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.weights import copy_weights

SCENARIO = Scenario.preset("two_clusters")
EVERY = pytest.mark.parametrize("name", sorted(ALGORITHMS))


def untrained(name: str, learners: tuple[int, ...] = (1,)) -> Policy:
    algorithm = ALGORITHMS[name](hidden_sizes=(8, 8))
    weights = copy_weights(algorithm.build(3, SCENARIO).loss)
    return learned_policy(SCENARIO, algorithm, weights, learners)


def size(policy: Policy) -> int:
    return 16 if policy.environment["clock"] else 15


@EVERY
def test_onnx_runtime_flies_as_the_policy_does(name: str, tmp_path: Path) -> None:
    runtime = pytest.importorskip("onnxruntime")
    policy, file = untrained(name), tmp_path / "policy.onnx"
    policy.export(file)
    session = runtime.InferenceSession(str(file))
    (observation,), (action,) = session.get_inputs(), session.get_outputs()
    assert (observation.name, observation.shape) == ("observation", ["batch", size(policy)])
    assert (action.name, action.shape) == ("action", ["batch", 2])
    told = json.loads(session.get_modelmeta().custom_metadata_map["environment"])
    assert told == policy.environment | {"scenario": SCENARIO.to_dict()}
    for rows in (1, 2, 7):
        observed = np.random.default_rng(0).uniform(-1, 1, (rows, size(policy)))
        flown = session.run(None, {"observation": observed.astype(np.float32)})[0]
        np.testing.assert_allclose(flown, policy.act(observed), atol=1e-6)


@EVERY
@pytest.mark.parametrize("suffix", ["pt", "pt2"])
@pytest.mark.filterwarnings("ignore:.*torch.jit.load.*deprecated")
def test_pytorch_loads_what_was_exported(name: str, suffix: str, tmp_path: Path) -> None:
    policy, file = untrained(name), tmp_path / f"policy.{suffix}"
    policy.export(str(file))
    kept: dict[str, Any] = {"environment": ""}
    if suffix == "pt":
        loaded: Any = torch.jit.load(file, _extra_files=kept)
    else:
        loaded = torch.export.load(file, extra_files=kept).module()
    assert Scenario.from_dict(json.loads(kept["environment"])["scenario"]) == SCENARIO
    for rows in (1, 2, 7):
        observed = torch.rand(rows, size(policy))
        torch.testing.assert_close(loaded(observed), policy.act(observed))


def test_several_learners_are_exported_together(tmp_path: Path) -> None:
    policy, file = untrained("td3_robust", (2, 0)), tmp_path / "policy.pt2"
    policy.export(file)
    observed = torch.rand(2, 5, 16)
    loaded = torch.export.load(file).module()
    torch.testing.assert_close(loaded(observed), policy.act(observed))


def test_an_export_leaves_the_policy_as_it_is(tmp_path: Path) -> None:
    network = torch.nn.Sequential(torch.nn.Linear(15, 2), torch.nn.Dropout(), torch.nn.Tanh())
    policy = Policy(network.double(), SCENARIO)
    policy.export(tmp_path / "policy.pt2")
    assert policy.training
    assert {values.dtype for values in policy.parameters()} == {torch.float64}
    assert all(values.requires_grad for values in policy.parameters())
    loaded = torch.export.load(tmp_path / "policy.pt2").module()
    observed = torch.rand(4, 15)
    torch.testing.assert_close(loaded(observed), policy.eval().act(observed).float())


def test_the_callers_default_type_is_not_exported(tmp_path: Path) -> None:
    torch.set_default_dtype(torch.float64)
    try:
        policy = untrained("sac")
        policy.export(tmp_path / "policy.pt2")
    finally:
        torch.set_default_dtype(torch.float32)
    loaded = torch.export.load(tmp_path / "policy.pt2").module()
    assert loaded(torch.zeros(3, 15)).dtype == torch.float32


@pytest.mark.parametrize("path", ["policy", "policy.pth", "policy.onnx.gz", ".pt", "", None, 3])
def test_a_file_of_another_kind_is_refused(path: Any) -> None:
    with pytest.raises(InputError, match=r"path = .*: expected .* \.onnx, \.pt2, \.pt$"):
        untrained("ddpg").export(path)


def test_a_place_that_cannot_be_written_to_is_refused(tmp_path: Path) -> None:
    policy = untrained("ddpg")
    (tmp_path / "file").write_text("")
    (tmp_path / "directory.pt").mkdir()
    for path in (tmp_path / "file" / "policy.pt", tmp_path / "directory.pt"):
        with pytest.raises(InputError, match=r"^path = .*: expected a file that can be written"):
            policy.export(path)
    assert sorted(own.name for own in tmp_path.iterdir()) == ["directory.pt", "file"]


def test_without_onnx_it_is_told_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("onnx", "onnxscript"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(InputError, match=r"^onnx, onnxscript cannot .* install 'hyuav\[export\]'$"):
        untrained("ddpg").export(tmp_path / "policy.onnx")
    assert list(tmp_path.iterdir()) == []


def test_an_export_tells_nothing_of_pytorchs_own(
    tmp_path: Path, recwarn: pytest.WarningsRecorder, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("onnxscript")
    for suffix in ("onnx", "pt2", "pt"):
        untrained("ddpg").export(tmp_path / f"policy.{suffix}")
    assert capfd.readouterr() == ("", "")
    assert not [each for each in recwarn if "torch" in str(each.filename)]
