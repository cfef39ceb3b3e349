"""The whole of Algorithm 1 from TorchRL's parts."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest
import torch

from hyuav import make_env

RECIPE = Path(__file__).parents[2] / "recipes" / "algorithm1.py"


@pytest.fixture(scope="module")
def recipe() -> ModuleType:
    spec = importlib.util.spec_from_file_location("algorithm1", RECIPE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_it_trains_an_actor_that_flies(
    recipe: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    torch.set_num_threads(1)
    actor, earned = recipe.train(episodes=3, batch_size=16)
    assert len(earned) == 3
    assert "episode 3:" in capsys.readouterr().out
    env = make_env("two_clusters", seed=1)
    flight = env.rollout(50, actor)
    assert flight["next", "done"][-1]
    assert flight["action"].abs().max() <= 1.0
    again, same = recipe.train(episodes=3, batch_size=16)
    assert same == earned
    before, after = (next(own.parameters()) for own in (actor, again))
    assert torch.equal(before, after)


def test_it_fits_a_screen_and_needs_nothing_but_the_environment() -> None:
    lines = RECIPE.read_text().splitlines()
    assert len(lines) < 100
    own = [line for line in lines if "hyuav" in line and "import" in line]
    assert own == ["from hyuav import make_env"]
