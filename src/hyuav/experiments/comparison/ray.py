"""A comparison's work done by Ray: on this machine without any set-up, or on a cluster."""

import contextlib
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from hyuav._support.errors import InputError, one_line, rejection
from hyuav.experiments.comparison.processes import attempt, reason, settle

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


@dataclass(frozen=True)
class RayWorkers:
    """The workers of the Ray that this process is connected to, on one core each.

    Those of a cluster must see the files of the pieces under the same names as this process does.
    """

    retries: int
    """How often a piece is begun again whose worker was lost."""

    def attempt_all(
        self, function: Callable[[Piece], None], pieces: Sequence[Piece]
    ) -> Iterator[tuple[Piece, str | None]]:
        """As :meth:`hyuav.experiments.comparison.processes.Workers.attempt_all`."""
        import ray
        from ray.exceptions import RayError, RayTaskError

        def work(piece: Piece) -> str | None:  # Ray takes no method and no partial
            settle()
            return attempt(function, piece)

        task = ray.remote(num_cpus=1, max_retries=0)(work)
        begun = {task.remote(piece): (piece, self.retries) for piece in pieces}
        while begun:
            (reference,), _ = ray.wait(list(begun))
            piece, left = begun.pop(reference)
            try:
                why = ray.get(reference)
            except RayTaskError as error:
                why = reason(error.cause)
            except RayError:
                if left:
                    begun[task.remote(piece)] = piece, left - 1
                    continue
                why = "its worker was lost" + (f", {self.retries + 1} times" * (self.retries > 0))
            yield piece, why


@contextlib.contextmanager
def ray_workers(address: str, number: int, retries: int) -> Iterator[RayWorkers]:
    """Be connected to Ray, which must be installed.

    Args:
        address: :data:`LOCAL`, :data:`AUTO` or HOST:PORT.
        number: of workers of a local one, which work at the same time.
        retries: how often a piece is begun again whose worker was lost.

    Yields:
        its workers.

    Raises:
        InputError: there is no Ray at the address.
    """
    if address not in (LOCAL, AUTO):
        _require_answer(address)
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    import ray  # reads the environment

    options: dict[str, Any] = {"log_to_driver": False, "logging_level": "CRITICAL"}
    if address == LOCAL:
        options |= {"num_cpus": number, "include_dashboard": False}
        options["object_store_memory"] = OBJECT_STORE_BYTES
    with _loopback_alone() if address == LOCAL else contextlib.nullcontext():
        handler = signal.getsignal(signal.SIGTERM)
        try:
            _connect(address, options)
            if threading.current_thread() is threading.main_thread():
                signal.signal(signal.SIGTERM, handler)  # Ray's own exits without a word
            yield RayWorkers(retries)
        finally:
            ray.shutdown()


@contextlib.contextmanager
def _loopback_alone() -> Iterator[None]:
    """A Ray that is started meanwhile listens there, as Ray does on Windows and macOS.

    Ray reads the switch for it when it is imported, which TorchRL has done by then.
    """
    from ray._private import ray_constants

    variable, clusters = ray_constants.ENABLE_RAY_CLUSTERS_ENV_VAR, ray_constants.ENABLE_RAY_CLUSTER
    before = os.environ.get(variable)
    os.environ[variable] = "0"  # for the processes that it starts
    ray_constants.ENABLE_RAY_CLUSTER = False
    try:
        yield
    finally:
        ray_constants.ENABLE_RAY_CLUSTER = clusters
        del os.environ[variable]
        if before is not None:
            os.environ[variable] = before


def _require_answer(address: str) -> None:
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), port), SECONDS_TO_ANSWER).close()
    except (OSError, ValueError, OverflowError) as error:
        raise _refusal(address, getattr(error, "strerror", None) or str(error)) from None


def _refusal(address: str, reason: str) -> InputError:
    accepted = f"{LOCAL}, {AUTO} or HOST:PORT of a Ray that runs ({one_line(reason)[:200]})"
    return InputError(rejection("address", address, accepted))


def _connect(address: str, options: dict[str, Any]) -> None:
    import ray

    for attempts_left in reversed(range(STARTS if address == LOCAL else 1)):
        try:
            ray.init(address, **options)
            return
        except Exception as error:  # Ray has no class for it
            ray.shutdown()
            if not attempts_left:
                raise _refusal(address, str(error)) from None
