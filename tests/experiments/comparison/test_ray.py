"""A Ray of our own is of this machine alone."""

import ipaddress
import socket
from collections.abc import Iterator

import psutil
import pytest

from hyuav._support.errors import InputError, brief
from hyuav.experiments.comparison.ray import LOCAL, ray_workers

Address = ipaddress.IPv4Address | ipaddress.IPv6Address


def listening(process: psutil.Process) -> Iterator[tuple[str, Address]]:
    """What it and those that it started listen on: their names, and the addresses."""
    for own in (process, *process.children(recursive=True)):
        for connection in own.net_connections("inet"):
            if connection.status == psutil.CONN_LISTEN:
                address = ipaddress.ip_address(connection.laddr.ip)
                yield own.name(), getattr(address, "ipv4_mapped", None) or address


@pytest.fixture
def unanswered() -> str:
    """An address of this machine at which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{probe.getsockname()[1]}"


def refused(address: str) -> str:
    """The line that answers an address, given before Ray is loaded and waits."""
    pytest.importorskip("ray")
    with pytest.raises(InputError) as caught, ray_workers(address, 1, 0):
        pass
    line, _, reason = str(caught.value).partition("of a Ray that runs")
    assert line == f"address = {brief(address)}: expected local, auto or HOST:PORT "
    assert "\n" not in reason
    return reason


def test_an_address_that_does_not_answer_is_refused_at_once(unanswered: str) -> None:
    assert refused(unanswered) == " (Connection refused)"


@pytest.mark.parametrize(
    "address",
    ["nowhere", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:99999", "a\0b:1", f"{'a' * 99}:1"],
)
def test_what_is_no_address_is_refused(address: str) -> None:
    assert refused(address)


@pytest.mark.slow
def test_it_listens_on_the_loopback_alone() -> None:
    pytest.importorskip("ray")
    with ray_workers(LOCAL, 2, 0) as workers:
        assert sorted(workers.attempt_all(print, [1, 2])) == [(1, None), (2, None)]
        found = set(listening(psutil.Process()))
    assert {"raylet", "gcs_server"} <= {name for name, _ in found}
    assert [own for own in found if not own[1].is_loopback] == []
