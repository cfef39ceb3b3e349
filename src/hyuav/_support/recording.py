"""Record what a function does to tensors as a graph, and compile the graph.

The function may be any PyTorch program without decisions that depend on numbers: TorchRL's
environments, losses and the gradients through them among it. It is run once, on tensors without
memory, and what it does becomes a list of tensor operations. Nothing of the Python that asked for
them is left, nor any check of it before each call, which is what costs in small networks.
"""

import os
import shlex
import shutil
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import torch
from tensordict.nn import CudaGraphModule
from torch import Tensor
from torch._dynamo.exc import BackendCompilerFailed
from torch._functorch.compile_utils import fx_graph_cse
from torch._guards import TracingContext, tracing
from torch._inductor.custom_graph_pass import CustomGraphPass, get_hash_for_files
from torch._inductor.exc import InductorError, InvalidCxxCompiler
from torch._subclasses.fake_tensor import FakeTensorMode
from torch.fx import Graph, GraphModule
from torch.fx.experimental.proxy_tensor import make_fx
from torch.fx.experimental.symbolic_shapes import ShapeEnv

COMPILATION_ERRORS = (BackendCompilerFailed, InductorError)
"""What :func:`compile_function` raises where there is no working compiler."""

WITHOUT_EXTRAS = {
    "aot_inductor.enable_frame_pointer": False,
    "aot_inductor.enable_line_tables": False,
    "cpp_cache_precompile_headers": False,
}
"""Options of Inductor: nothing for profilers, and no headers made ready, as both cost more time
than they save."""


class DoOnce(CustomGraphPass):
    """What a graph does twice to the same tensors, let it do once.

    Losses that know nothing of each other ask for the same networks' outputs.
    """

    def __call__(self, graph: Graph) -> None:
        """Change the graph's module, which Inductor has freed of all changes in place."""
        module = graph.owning_module
        assert module is not None
        module.graph = fx_graph_cse(graph)

    def uuid(self) -> bytes:
        """By which compiled graphs are found on the disk again."""
        return get_hash_for_files((__file__,))


def has_compiler(device: torch.device) -> bool:
    """Whether there is a compiler for the device, working or not."""
    command = shlex.split(os.environ.get("CXX", "")) or ["g++"]
    return device.type != "cpu" or shutil.which(command[0]) is not None


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


def compile_function(
    function: Callable[..., None], inputs: Sequence[Tensor]
) -> Callable[..., None]:
    """A function that does what ``function`` does, compiled for the shapes of ``inputs``.

    On a CPU it is one C++ program, which other threads need not wait for; on a GPU one CUDA graph.

    Args:
        function: see :func:`record`.
        inputs: examples of what it takes.

    Raises:
        Exception: one of :data:`COMPILATION_ERRORS`.
    """
    graph, tensors = record(function, inputs)
    on_cpu = all(tensor.device.type == "cpu" for tensor in tensors)
    options = {
        "cpp_wrapper": on_cpu,
        "cpp.use_decompose_tanh": True,
        "memory_planning": on_cpu,
        "pattern_matcher": False,
        "size_asserts": False,
        "post_grad_custom_pre_pass": DoOnce(),
    }  # which docs/performance.md explains
    program = compile_graph(graph, [*inputs, *tensors], options)

    def run(*values: Tensor) -> None:
        program(*values, *tensors)

    return run if on_cpu else CudaGraphModule(run)


def compile_graph(
    graph: GraphModule, arguments: Sequence[Tensor], options: dict[str, Any]
) -> Callable[..., Any]:
    """Let Inductor compile a graph of tensor operations, or find it compiled on the disk.

    A compiler is trusted to know this processor's instructions. Only where it fails must it prove
    which it knows, since that takes a third of the time.

    Args:
        graph: to compile.
        arguments: examples of what it takes.
        options: of Inductor.

    Raises:
        Exception: one of :data:`COMPILATION_ERRORS`.
    """
    try:
        return _compile(graph, arguments, {**options, "cpp.vec_isa_ok": True})
    except COMPILATION_ERRORS as error:
        if isinstance(error.inner_exception, InvalidCxxCompiler):  # it does not even start
            raise
        return _compile(graph, arguments, options)


def _compile(
    graph: GraphModule, arguments: Sequence[Tensor], options: dict[str, Any]
) -> Callable[..., Any]:
    fake = FakeTensorMode(shape_env=ShapeEnv())  # which Inductor's cache on the disk needs
    examples: Any = [fake.from_tensor(each, static_shapes=True) for each in arguments]
    options = {**WITHOUT_EXTRAS, **options}
    with torch.no_grad(), tracing(TracingContext(fake)), warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of PyTorch's own modules
        return torch._inductor.compile(graph, examples, options=options)
