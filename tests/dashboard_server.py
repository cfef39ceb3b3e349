"""The dashboard's server as a person starts it, for tests over HTTP."""

import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

RECIPES = Path(__file__).parents[1] / "recipes"


def free_port() -> int:
    """One that nobody listens on at the moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def recipe(name: str, *arguments: str, cwd: Path) -> Iterator["subprocess.Popen[str]"]:
    """Run a recipe in a process of its own, which is ended at the latest with the block."""
    process = subprocess.Popen(
        [sys.executable, str(RECIPES / f"{name}.py"), *arguments],
        cwd=cwd,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
        process.communicate()


@contextmanager
def dashboard(runs: Path) -> Iterator[tuple[str, "subprocess.Popen[str]"]]:
    """Serve a directory of runs; gives the address, once it answers, and the process."""
    port = free_port()
    address = f"http://127.0.0.1:{port}"
    with recipe("dashboard", f"runs={runs}", f"port={port}", cwd=runs.parent) as process:
        while not _answers(address):
            assert process.poll() is None, process.communicate()[0]
            time.sleep(0.1)
        yield address, process


def _answers(address: str) -> bool:
    try:
        with urllib.request.urlopen(f"{address}/_stcore/health", timeout=5) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False
