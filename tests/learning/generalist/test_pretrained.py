"""What comes with the package: weights that are safe to read, and files for other runtimes."""

from pathlib import Path

import numpy as np
import pytest
import torch

import hyuav
from hyuav import InputError
from hyuav.learning.generalist.network import GeneralistNetwork
from hyuav.learning.generalist.pretrained import Generalist
from hyuav.learning.generalist.scene import VIEW_SIZE
from hyuav.learning.generalist.tokens import TOKEN_SIZE


def test_weights_are_small_and_hold_no_code() -> None:
    folder = Path(hyuav.__file__).parent / "learning" / "generalist" / "weights"
    assert (folder / "generalist.npz").stat().st_size < 4 * 10**6
    with np.load(folder / "generalist.npz", allow_pickle=False) as arrays:
        assert all(arrays[name].dtype == np.float16 for name in arrays.files)
    assert hyuav.pretrained("generalist").card.startswith("# ")


def test_weights_are_kept_and_read_again(tmp_path: Path) -> None:
    torch.manual_seed(0)
    network = GeneralistNetwork()
    Generalist(network).save(tmp_path / "own.npz")
    with np.load(tmp_path / "own.npz") as arrays:
        for name, own in network.state_dict().items():
            np.testing.assert_array_equal(arrays[name], own.half().numpy())


def test_another_name_is_refused() -> None:
    with pytest.raises(InputError, match=r"^name = 'specialist': expected one of generalist$"):
        hyuav.pretrained("specialist")


def test_onnx_runtime_decides_as_the_network_does(tmp_path: Path) -> None:
    runtime = pytest.importorskip("onnxruntime")
    generalist, file = hyuav.pretrained("generalist"), tmp_path / "generalist.onnx"
    generalist.export(file)
    session = runtime.InferenceSession(str(file))
    generator = torch.Generator().manual_seed(0)
    for helpers, tokens in ((1, 6), (5, 40)):
        inputs = {
            "views": torch.rand(helpers, VIEW_SIZE, generator=generator),
            "tokens": torch.rand(tokens, TOKEN_SIZE, generator=generator),
            "owner": torch.randint(helpers, (tokens,), generator=generator).sort().values,
            "slots_left": torch.randint(30, (helpers,), generator=generator),
        }
        told = session.run(None, {name: own.numpy() for name, own in inputs.items()})[0]
        np.testing.assert_allclose(told, generalist.network(*inputs.values()).numpy(), atol=1e-4)
