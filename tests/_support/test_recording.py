import pytest
import torch
from torch import Tensor
from torch.fx.experimental.proxy_tensor import make_fx

from hyuav._support.recording import DoOnce, compile_function, record


def test_what_a_function_does_is_recorded_and_not_done() -> None:
    state, table = torch.zeros(3), torch.arange(6.0).reshape(3, 2)

    def function(change: Tensor, row: Tensor) -> None:
        state.add_(change)
        table.index_copy_(0, row, state[:2].unsqueeze(0))

    graph, tensors = record(function, [torch.ones(3), torch.tensor([1])])
    assert torch.equal(state, torch.zeros(3))
    assert {tensor.data_ptr() for tensor in tensors} == {state.data_ptr(), table.data_ptr()}
    graph(torch.full((3,), 2.0), torch.tensor([2]), *tensors)
    assert state.tolist() == [2.0, 2.0, 2.0]
    assert table.tolist() == [[0.0, 1.0], [2.0, 3.0], [2.0, 2.0]]


def test_a_parameter_and_its_data_are_one_tensor() -> None:
    weight = torch.nn.Parameter(torch.ones(2, 2))

    def descend(inputs: Tensor) -> None:
        with torch.enable_grad():
            loss = (inputs @ weight).square().sum()
            (gradient,) = torch.autograd.grad(loss, [weight])
        weight.data.sub_(0.1 * gradient)

    inputs = torch.randn(5, 2)
    graph, tensors = record(descend, [inputs])
    assert len(tensors) == 1
    expected = 1.0 - 0.2 * inputs.T @ (inputs @ torch.ones(2, 2))
    with torch.no_grad():
        graph(inputs, *tensors)
    torch.testing.assert_close(weight.data, expected)


def test_a_decision_on_numbers_is_refused() -> None:
    state = torch.zeros(3)

    def function(change: Tensor) -> None:
        if bool((change > 0).any()):
            state.add_(change)

    with pytest.raises(RuntimeError):
        record(function, [torch.ones(3)])


def test_a_compiled_function_does_the_same_in_every_call() -> None:
    state = torch.zeros(3)

    def function(change: Tensor) -> None:
        state.add_(change.tanh())

    program = compile_function(function, [torch.ones(3)])
    assert torch.equal(state, torch.zeros(3))
    change = torch.tensor([0.1, -2.0, 30.0])
    for times in range(1, 4):
        program(change)
        torch.testing.assert_close(state, times * change.tanh())


def test_what_is_asked_for_twice_is_done_once() -> None:
    twice = make_fx(lambda inputs, weight: (inputs @ weight).tanh() + inputs @ weight)
    inputs, weight = torch.randn(4, 3), torch.randn(3, 2)
    module = twice(inputs, weight)
    DoOnce()(module.graph)
    targets = [node.target for node in module.graph.nodes]
    assert targets.count(torch.ops.aten.mm.default) == 1
    product = inputs @ weight
    torch.testing.assert_close(module(inputs, weight), product.tanh() + product)


def test_what_changes_in_between_is_done_again() -> None:
    weight, state = torch.eye(3), torch.zeros(3)

    def function(change: Tensor) -> None:
        for _ in range(2):
            state.add_((change @ weight).sum(dim=0))
        weight.add_(change.mT @ change / 2)
        state.add_((change @ weight).sum(dim=0))

    program = compile_function(function, [torch.ones(2, 3)])
    program(torch.ones(2, 3))
    assert state.tolist() == [2.0 + 2.0 + 8.0] * 3
