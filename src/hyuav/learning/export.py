"""Networks as files that fly without this library: ONNX, and PyTorch's own two formats."""

import copy
import io
import json
import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from hyuav._support.errors import InputError, cause, rejection
from hyuav._support.files import write_durably
from hyuav._support.machine import require_installed
from hyuav._support.parameters import Parameters

ENVIRONMENT = "environment"
"""The name under which a file tells what environment the network needs."""


class Signature(NamedTuple):
    """What a network takes and gives."""

    examples: Mapping[str, Tensor]
    """Of its inputs, in their order."""
    free: Mapping[str, Mapping[int, str]]
    """The axes of the inputs that may have any length, and the name of that length."""
    output: str

    @property
    def inputs(self) -> tuple[Tensor, ...]:
        """The examples in order."""
        return tuple(self.examples.values())

    @property
    def dynamic_shapes(self) -> tuple[dict[int, torch.export.Dim], ...]:
        """The free axes as ``torch.export`` has them."""
        names = {name for axes in self.free.values() for name in axes.values()}
        lengths = {name: torch.export.Dim(name) for name in names}
        return tuple(
            {axis: lengths[name] for axis, name in self.free.get(own, {}).items()}
            for own in self.examples
        )


def export(
    network: nn.Module, path: str | Path, signature: Signature, environment: Mapping[str, Any]
) -> None:
    """Write a network to a file, in the format that the suffix tells.

    The network itself stays as it is and where it is; what is written computes in float32.

    Args:
        network: of plain tensors.
        path: of the file: ``.onnx``, ``.pt2`` (torch.export) or ``.pt`` (TorchScript).
        signature: what it takes and gives; floating-point examples are float32.
        environment: kept beside it in JSON.

    Raises:
        InputError: another suffix, a place that cannot be written to, or what writes ONNX is not
            installed.
    """
    if not isinstance(path, str | Path) or Path(path).suffix not in ENCODERS:
        accepted = f"a file name that ends in {', '.join(ENCODERS)}"
        raise InputError(rejection("path", path if isinstance(path, str) else str(path), accepted))
    encode, told = ENCODERS[Path(path).suffix], json.dumps(environment, default=_plain)
    own = copy.deepcopy(network).to(signature.inputs[0]).requires_grad_(False).eval()
    with _quiet():
        content = encode(own, signature, told)
    try:
        write_durably(Path(path), content)
    except OSError as error:
        accepted = f"a file that can be written ({cause(error)})"
        raise InputError(rejection("path", str(path), accepted)) from None


def _plain(value: Any) -> Any:
    """A scenario by its fields, a reward by its name."""
    return value.to_dict() if isinstance(value, Parameters) else value.name


def _onnx(network: nn.Module, signature: Signature, environment: str) -> bytes:
    require_installed(("onnx", "onnxscript"), "export")
    program = torch.onnx.export(
        network,
        signature.inputs,
        dynamic_shapes=signature.dynamic_shapes,
        input_names=list(signature.examples),
        output_names=[signature.output],
        dynamo=True,
        verbose=False,
    )
    assert program is not None
    program.model.metadata_props[ENVIRONMENT] = environment
    return program.model_proto.SerializeToString()


def _pt2(network: nn.Module, signature: Signature, environment: str) -> bytes:
    file = io.BytesIO()
    program = torch.export.export(
        network, signature.inputs, dynamic_shapes=signature.dynamic_shapes
    )
    torch.export.save(program, file, extra_files={ENVIRONMENT: environment})
    return file.getvalue()


def _torchscript(network: nn.Module, signature: Signature, environment: str) -> bytes:
    file = io.BytesIO()
    traced = torch.jit.trace(network, signature.inputs)  # which scripting cannot follow
    torch.jit.save(traced, file, _extra_files={ENVIRONMENT: environment})
    return file.getvalue()


ENCODERS = {".onnx": _onnx, ".pt2": _pt2, ".pt": _torchscript}
"""By the suffix of the file."""


@contextmanager
def _quiet() -> Iterator[None]:
    """Let PyTorch tell nothing of libraries that it misses, and of what it will give up."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)
