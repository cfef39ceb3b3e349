"""The arithmetic floor."""

import pytest
import torch
from torch.utils.flop_counter import FlopCounterMode

from benchmarks.arithmetic import matrix_rate, update_flops
from benchmarks.torchrl_loop import TorchRLLoop
from benchmarks.work import Work
from hyuav import Scenario

PAPER = (300, 100, 100)


def test_an_update_at_the_papers_sizes_takes_62_mflop() -> None:
    assert update_flops(15, PAPER, 70) / 1e6 == pytest.approx(61.7, abs=0.1)


@pytest.mark.parametrize(("hidden", "batch"), [(PAPER, 70), ((8,), 3)])
def test_an_update_takes_what_pytorch_counts(hidden: tuple[int, ...], batch: int) -> None:
    work = Work(Scenario.preset("two_clusters"), hidden_sizes=hidden, batch_size=batch)
    loop = TorchRLLoop(work)  # its loss asks for no gradient that it does not use
    loop.advance()
    with FlopCounterMode(display=False) as counter:
        loop.update()
    assert counter.get_total_flops() == update_flops(15, hidden, batch)


def test_the_machines_rate_is_that_of_its_best_product() -> None:
    threads = torch.get_num_threads()
    assert 1e8 < matrix_rate(1, seconds=0.02) < 1e15
    assert torch.get_num_threads() == threads
