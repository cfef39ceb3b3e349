import torch

from hyuav.learning.randomness import RandomStream


def test_a_stream_goes_on_where_it_was_suspended() -> None:
    whole, broken = (RandomStream(3, torch.device("cpu")) for _ in range(2))
    with whole.active():
        expected = torch.rand(6)
    with broken.active():
        first = torch.rand(3)
    torch.rand(5)
    with broken.active():
        second = torch.rand(3)
    assert torch.equal(torch.cat([first, second]), expected)


def test_a_stream_leaves_the_global_generator_alone() -> None:
    torch.manual_seed(5)
    expected = torch.rand(4)
    torch.manual_seed(5)
    stream = RandomStream(3, torch.device("cpu"))
    with stream.active():
        torch.rand(100)
    assert torch.equal(torch.rand(4), expected)
