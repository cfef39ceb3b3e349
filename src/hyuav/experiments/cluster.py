"""Ray: on this machine without any set-up, or a cluster by its address (the extra ``cluster``)."""

import contextlib
import importlib.util
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar
from unittest import mock

from hyuav._support.errors import InputError, one_line, rejection

LOCAL = "local"
"""The address of a Ray that is started for the work and ends with it."""

AUTO = "auto"
"""The address of the Ray that runs on this machine."""

OBJECT_STORE_BYTES = 100 * 2**20
"""Of a Ray of our own. What passes between processes is small: results lie in files."""

SECONDS_TO_ANSWER = 5.0
"""Within which the machine at an address must answer; Ray itself would wait for minutes."""

STARTS = 3
"""How often a Ray of our own is started; on a busy machine the first may come up too late."""

_ENVIRONMENT = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_COLOR_PREFIX": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # as will be Ray's default, of which it warns
}

Piece = TypeVar("Piece")


def require_ray() -> None:
    """Accept the wish for Ray where it can be imported.

    Raises:
        InputError: naming the extra.
    """
    if importlib.util.find_spec("ray") is None:
        raise InputError("ray cannot be imported: pip install 'hyuav[cluster]'")


@contextlib.contextmanager
def connected(address: str, workers: int, *, prints: bool) -> Iterator[None]:
    """Be connected to Ray.

    Args:
        address: :data:`LOCAL`, :data:`AUTO` or HOST:PORT.
        workers: of a local one, which work at the same time.
        prints: whether what the workers print is printed here.

    Raises:
        InputError: Ray cannot be imported, or there is none at the address.
    """
    require_ray()
    if address not in (LOCAL, AUTO):
        _require_answer(address)
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    import ray  # reads the environment

    options: dict[str, Any] = {"log_to_driver": prints, "logging_level": "CRITICAL"}
    if address == LOCAL:
        options |= {"num_cpus": workers, "include_dashboard": False}
        options["object_store_memory"] = OBJECT_STORE_BYTES
    with _loopback_alone() if address == LOCAL else contextlib.nullcontext():
        handler = signal.getsignal(signal.SIGTERM)
        try:
            _connect(address, options)
            if threading.current_thread() is threading.main_thread():
                signal.signal(signal.SIGTERM, handler)  # Ray's own exits without a word
            yield
        finally:
            ray.shutdown()


@contextlib.contextmanager
def _loopback_alone() -> Iterator[None]:
    """A Ray that is started meanwhile listens there, as Ray does on Windows and macOS.

    Ray reads the switch for it when it is imported, which TorchRL has done by then.
    """
    from ray._private import ray_constants

    switch = {ray_constants.ENABLE_RAY_CLUSTERS_ENV_VAR: "0"}  # for the processes that it starts
    with (
        mock.patch.dict(os.environ, switch),
        mock.patch.object(ray_constants, "ENABLE_RAY_CLUSTER", False),
    ):
        yield


def _require_answer(address: str) -> None:
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), port), SECONDS_TO_ANSWER).close()
    except (OSError, ValueError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise _refusal(address, reason) from None


def _refusal(address: str, reason: str) -> InputError:
    accepted = f"{LOCAL}, {AUTO} or HOST:PORT of a Ray that runs ({one_line(reason)[:200]})"
    return InputError(rejection("address", address, accepted))


def _connect(address: str, options: dict[str, Any]) -> None:
    import ray

    for attempt in range(1, STARTS + 1):
        try:
            ray.init(address, **options)
        except Exception as error:  # Ray has no class for it
            ray.shutdown()
            if address == LOCAL and attempt < STARTS:
                continue
            raise _refusal(address, str(error)) from None
        return


def outcomes(
    function: Callable[[Piece], Any], pieces: Sequence[Piece], *, retries: int
) -> Iterator[tuple[Piece, Any]]:
    """Do pieces of work on Ray's workers, one processor core each.

    Args:
        function: does a piece.
        pieces: of work.
        retries: how often a piece is begun again whose worker was lost.

    Yields:
        each piece when it is done, and what the function returned; the exception where it raised
        one, and a ``ChildProcessError`` where the worker was lost for good.
    """
    import ray
    from ray.exceptions import RayError, RayTaskError

    def work(piece: Piece) -> Any:  # Ray takes no method and no partial
        return function(piece)

    task = ray.remote(num_cpus=1, max_retries=0)(work)
    begun = {task.remote(piece): (piece, retries) for piece in pieces}
    while begun:
        (reference,), _ = ray.wait(list(begun))
        piece, left = begun.pop(reference)
        outcome: Any
        try:
            outcome = ray.get(reference)
        except RayTaskError as error:
            outcome = error.cause
        except RayError:
            if left:
                begun[task.remote(piece)] = piece, left - 1
                continue
            times = f", {retries + 1} times" if retries else ""
            outcome = ChildProcessError(f"its worker was lost{times}")
        yield piece, outcome
