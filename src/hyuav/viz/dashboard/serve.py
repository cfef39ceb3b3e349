"""Starting the dashboard's server in this process."""

import importlib.util
import ipaddress
import os
import socket
from pathlib import Path

from pydantic.dataclasses import dataclass

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import Count, Parameters, Text, ZeroOrMore, parameter
from hyuav.experiments.own_code import OwnAlgorithm, OwnReward

APP = Path(__file__).with_name("app.py")

LIBRARIES = ("streamlit", "plotly")


@dataclass(frozen=True)
class Dashboard(Parameters):
    """What the dashboard shows, and where."""

    runs: Text = parameter("runs")
    """The directory of the runs; it may be filled later."""
    algorithm: ZeroOrMore[OwnAlgorithm] = parameter(())
    """Their own algorithms; a run's directory names a file, but only you let it be run."""
    reward: ZeroOrMore[OwnReward] = parameter(())
    """Their own rewards, for the same reason."""
    port: Count = parameter(8501)
    address: Text = parameter("127.0.0.1")
    """Of the network interface to be reached by; the default is this machine alone."""
    open: bool = parameter(False)
    """Whether to open a browser."""


def serve(options: Dashboard) -> None:
    """Serve the dashboard until Ctrl-C.

    Raises:
        InputError: Streamlit or Plotly are not installed, the runs are no directory, or the
            address and port cannot be had.
    """
    missing = [name for name in LIBRARIES if importlib.util.find_spec(name) is None]
    if missing:
        names = ", ".join(missing)
        raise InputError(f"{names} cannot be imported: pip install 'hyuav[dashboard]'")
    runs = Path(options.runs)
    if runs.exists() and not runs.is_dir():
        raise InputError(rejection("runs", options.runs, "a directory"))
    _require_free(options.address, options.port)
    from streamlit.web import cli

    cli.main(
        ["run", *_flags(options), str(APP), "--", os.path.realpath(runs)], standalone_mode=False
    )


def _require_free(address: str, port: int) -> None:
    """Accept an address of this machine with a port that nobody listens on."""
    try:
        family = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((address, port))
    except (OSError, ValueError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        accepted = f"an address and a port of this machine that are free ({reason})"
        raise InputError(rejection("address", f"{address}:{port}", accepted)) from None


def _flags(options: Dashboard) -> list[str]:
    """Streamlit's options: nothing is reported, nothing is watched, errors stay on one line."""
    settings = {
        "server.address": options.address,
        "server.port": options.port,
        "server.headless": str(not options.open).lower(),
        "server.fileWatcherType": "none",
        "server.showEmailPrompt": "false",
        "browser.gatherUsageStats": "false",
        "client.toolbarMode": "minimal",
        "client.showErrorDetails": "none",
        "client.showErrorLinks": "false",
        "runner.magicEnabled": "false",
        "theme.base": "light",
        "theme.primaryColor": "#0072B2",
        "theme.paddingTop": "1.5rem",
    }
    flags = [f"--{name}={value}" for name, value in settings.items()]
    if _is_loopback(options.address):  # or another site's page could reach it by its own name
        flags += [f"--server.allowedHosts={host}" for host in ("localhost", options.address)]
    return flags


def _is_loopback(address: str) -> bool:
    if address == "localhost":
        return True
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return False
