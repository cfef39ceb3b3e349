import importlib.util
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from dashboard_server import RECIPES, dashboard
from recipe_calls import Refusal


def test_it_serves_this_machine_alone_until_interrupted(tmp_path: Path) -> None:
    with dashboard(tmp_path / "runs") as (address, process):
        with urllib.request.urlopen(address) as answer:
            assert answer.status == 200
        with socket.socket() as other, pytest.raises(ConnectionRefusedError):
            other.connect(("127.0.0.2", int(address.rpartition(":")[2])))
        process.send_signal(signal.SIGINT)
        printed, _ = process.communicate(timeout=60)
        assert process.returncode == 0
        assert address in printed
        assert "Traceback" not in printed
    assert list(tmp_path.iterdir()) == []


def test_a_port_that_is_taken_is_named(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        ended = subprocess.run(
            [sys.executable, RECIPES / "dashboard.py", f"port={port}"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
    assert ended.returncode == 2
    assert ended.stderr.startswith(f"error: address = '127.0.0.1:{port}': expected an address and")
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("argument", "line"),
    [
        ("runs=file", "runs = 'file': expected a directory"),
        ("address=192.0.2.1", "address = '192.0.2.1:8501': expected an address and a port"),
        ("address=nowhere.invalid", "expected an address and a port of this machine"),
        ("address=a..b", "address = 'a..b:8501': expected an address and a port"),
        ("port=70000", "expected an address and a port of this machine"),
        ("port=0", "port = 0: expected a whole number >= 1"),
        ("prt=3", "configuration: unknown field 'prt': did you mean 'port'"),
    ],
)
def test_a_mistake_is_answered_by_one_line(
    refusal: Refusal, tmp_path: Path, argument: str, line: str
) -> None:
    (tmp_path / "file").write_text("")
    assert line in refusal("dashboard", argument)


def test_without_streamlit_it_says_how_to_get_it(
    refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = importlib.util.find_spec

    def find(name: str) -> object:
        return None if name == "streamlit" else found(name)

    monkeypatch.setattr(importlib.util, "find_spec", find)
    expected = "error: streamlit cannot be imported: pip install 'hyuav[dashboard]'\n"
    assert refusal("dashboard") == expected
