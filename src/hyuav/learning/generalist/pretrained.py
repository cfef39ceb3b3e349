"""The weights that come with the package."""

import io
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hyuav._support.errors import InputError, cause, rejection, require_choice
from hyuav._support.files import write_durably
from hyuav.learning.export import Signature, export
from hyuav.learning.generalist.network import GeneralistNetwork
from hyuav.learning.generalist.policy import GeneralistPolicy
from hyuav.learning.generalist.scene import REACH, STEPS, VIEW_SIZE, VIEWS
from hyuav.learning.generalist.tokens import TOKEN_SIZE
from hyuav.physics.modes import fixed_modes
from hyuav.physics.scenario import ScenarioLike, as_scenario

PRETRAINED = ("generalist",)
"""What comes with the package."""


class Generalist:
    """One policy for every layout: a network that was trained across scenarios.

    Args:
        network: what it has learned.
        card: what it was trained on, by which command, how well it flies, and its limits.

    Example:
        >>> generalist = hyuav.pretrained("generalist")
        >>> policy = generalist.policy("two_clusters")
        >>> hyuav.make_env("two_clusters", batch_size=64, seed=0).rollout(20, policy)
    """

    def __init__(self, network: GeneralistNetwork, card: str = "") -> None:
        self.network = network.eval().requires_grad_(False)
        self.card = card

    def policy(self, scenario: ScenarioLike, mode_rule: str = "hybrid") -> GeneralistPolicy:
        """The policy in a scenario, of which it computes first what one slot brings where.

        Args:
            scenario: to fly, or the name of a preset.
            mode_rule: who chooses the mode: hybrid, relay or jamming.

        Raises:
            InputError: an unknown preset or mode rule.
        """
        scenario = as_scenario(scenario)
        fixed_modes(mode_rule, scenario.num_helpers, "mode_rule")
        return GeneralistPolicy(self.network, scenario, mode_rule)

    def export(self, path: str | Path) -> None:
        """Write the network to a file: ``.onnx``, ``.pt2`` (torch.export) or ``.pt`` (TorchScript).

        Its inputs are those of :meth:`.network.GeneralistNetwork.forward`, for any number of
        helpers and tokens; its output is ``values_to_go``.

        Raises:
            InputError: another suffix, a place that cannot be written to, or what writes ONNX is
                not installed.
        """
        examples = {
            "views": torch.zeros(2, VIEW_SIZE),
            "tokens": torch.zeros(24, TOKEN_SIZE),
            "owner": torch.arange(2).repeat_interleave(12),
            "slots_left": torch.tensor([3, 9]),
        }
        free = {
            "views": {0: "helpers"},
            "tokens": {0: "tokens"},
            "owner": {0: "tokens"},
            "slots_left": {0: "helpers"},
        }
        environment = {"views": VIEWS, "reach": REACH, "steps": STEPS, "token": TOKEN_SIZE}
        export(self.network, path, Signature(examples, free, "values_to_go"), environment)

    def save(self, path: str | Path) -> None:
        """Write the weights as NumPy arrays in half precision, ``.npz``, which hold no code.

        Raises:
            InputError: the file cannot be written.
        """
        file = io.BytesIO()
        weights = {name: own.half().numpy() for name, own in self.network.state_dict().items()}
        np.savez(file, allow_pickle=False, **weights)
        try:
            write_durably(Path(path), file.getvalue())
        except OSError as error:
            accepted = f"a file that can be written ({cause(error)})"
            raise InputError(rejection("path", str(path), accepted)) from None


@cache
def pretrained(name: str = "generalist") -> Generalist:
    """What comes with the package, trained.

    Raises:
        InputError: nothing of that name does.
    """
    require_choice("name", name, PRETRAINED)
    folder = resources.files("hyuav.learning.generalist").joinpath("weights")
    content = io.BytesIO(folder.joinpath(f"{name}.npz").read_bytes())
    network = GeneralistNetwork()
    network.load_state_dict(_arrays(content))
    return Generalist(network, folder.joinpath(f"{name}.md").read_text("utf-8"))


def _arrays(content: Any) -> dict[str, Tensor]:
    with np.load(content, allow_pickle=False) as arrays:
        return {name: torch.from_numpy(arrays[name]).float() for name in arrays.files}
