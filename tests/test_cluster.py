"""A Ray of our own is of this machine alone."""

import ipaddress
from collections.abc import Iterator

import psutil
import pytest

from hyuav.cluster import LOCAL, connected, outcomes

Address = ipaddress.IPv4Address | ipaddress.IPv6Address


def listening(process: psutil.Process) -> Iterator[tuple[str, Address]]:
    """What it and those that it started listen on: their names, and the addresses."""
    for own in (process, *process.children(recursive=True)):
        for connection in own.net_connections("inet"):
            if connection.status == psutil.CONN_LISTEN:
                address = ipaddress.ip_address(connection.laddr.ip)
                yield own.name(), getattr(address, "ipv4_mapped", None) or address


@pytest.mark.slow
def test_it_listens_on_the_loopback_alone() -> None:
    pytest.importorskip("ray")
    with connected(LOCAL, 2, prints=False):
        assert sorted(piece for piece, _ in outcomes(str, [1, 2], retries=0)) == [1, 2]
        found = set(listening(psutil.Process()))
    assert {"raylet", "gcs_server"} <= {name for name, _ in found}
    assert [own for own in found if not own[1].is_loopback] == []
