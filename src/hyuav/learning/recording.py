"""Record what a function does to tensors as a graph, and compile the graph.

The function may be any PyTorch program without decisions that depend on numbers: TorchRL's
environments, losses and the gradients through them among it. It is run once, on tensors without
memory, and what it does becomes a list of tensor operations. Nothing of the Python that asked for
them is left, nor any check of it before each call, which is what costs in small networks.
"""

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor
from torch._dynamo.exc import BackendCompilerFailed
from torch._inductor.exc import InductorError
from torch.fx import GraphModule
from torch.fx.experimental.proxy_tensor import make_fx

COMPILATION_ERRORS = (BackendCompilerFailed, InductorError)
"""What :func:`compile_recorded` raises where there is no working compiler."""


def record(
    function: Callable[..., None], inputs: Sequence[Tensor]
) -> tuple[GraphModule, list[Tensor]]:
    """The tensor operations of ``function``, which reads ``inputs`` and changes other tensors.

    Args:
        function: what to record; what it returns is lost.
        inputs: tensors that differ from call to call, of which shape and type matter here.

    Returns:
        the graph, and the other tensors that it reads or changes: the graph takes ``inputs``,
        then these.
    """

    def without_result(*arguments: Tensor) -> tuple[()]:
        function(*arguments)
        return ()

    traced = make_fx(without_result, tracing_mode="fake", _allow_non_fake_inputs=True)(*inputs)
    nodes = list(traced.graph.nodes)
    last = [node for node in nodes if node.op == "placeholder"][-1]
    found: dict[Any, Any] = {}
    tensors: list[Tensor] = []
    for node in nodes:
        node.meta.clear()  # Inductor finds out types and shapes anew
        if node.op != "get_attr":
            continue
        tensor = getattr(traced, node.target).detach()
        memory = (tensor.data_ptr(), tensor.shape, tensor.stride(), tensor.dtype)
        if memory not in found:
            with traced.graph.inserting_after(last):
                last = found[memory] = traced.graph.placeholder(f"tensor_{len(tensors)}")
            tensors.append(tensor)
        node.replace_all_uses_with(found[memory])
        traced.graph.erase_node(node)
    traced.graph.lint()
    return GraphModule(torch.nn.Module(), traced.graph), tensors


def compile_recorded(
    graph: GraphModule, arguments: Sequence[Tensor], *, beside_others: bool
) -> Callable[..., Any]:
    """Make one program of a recorded graph; arguments of other values may be given to it.

    Args:
        graph: from :func:`record`.
        arguments: all that it takes.
        beside_others: whether other threads run programs at the same time.

    Raises:
        One of :data:`COMPILATION_ERRORS`.
    """
    options: dict[str, Any] = {
        "cpp.use_decompose_tanh": True,
        "cpp.threads": 1,
        "cpp_wrapper": beside_others,  # so that it runs without Python's lock
    }
    with torch.no_grad():
        return torch._inductor.compile(graph, list(arguments), options=options)
