"""Workers of dask.distributed: connecting to them, and errors of the connection."""

from __future__ import annotations

import contextlib
import logging
import os
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar

from palpate import _native
from palpate.errors import ClusterError
from palpate.units import brief_repr

if TYPE_CHECKING:
    from distributed import Client, Future, Security

# For the scheduler to answer, and for a first worker to join it, s.
CONNECT_SECONDS = 5.0
# Between looks for workers that have come or gone, s.
POLL_SECONDS = 1.0

Item = TypeVar("Item")


@contextlib.contextmanager
def connected(dask: str | Client) -> Iterator[Client]:
    """Client of the scheduler at an address, such as ``"tcp://10.0.0.1:8786"``; a client of one's own stays open.

    A ``tls://`` address takes the certificates of dask's own configuration (``distributed.comm.tls``: a file of
    ``~/.config/dask``, ``DASK_DISTRIBUTED__COMM__TLS__...``), a client of one's own its ``distributed.Security``.

    Raises ClusterError if dask.distributed is not installed, no scheduler answers, the certificates are missing or
    others, or no worker with this version of Palpate is there.
    """
    try:
        import distributed
    except ImportError:
        raise ClusterError("a cluster needs dask.distributed: pip install 'palpate[cluster]'") from None
    if isinstance(dask, distributed.Client):
        with _reporting_lost_connection():
            _require_workers(dask)
            yield dask
        return
    if not isinstance(dask, str):
        raise ClusterError(f"dask takes the address of a scheduler, or a distributed.Client; got {brief_repr(dask)}")
    _require_address(dask)
    with _muted_library_log():
        security = _security_for(dask)
        try:
            client = distributed.Client(dask, security=security, timeout=CONNECT_SECONDS, set_as_default=False)
        except (OSError, ValueError, TimeoutError):
            which = " with these certificates" if security.require_encryption else ""
            raise ClusterError(
                f"no scheduler answers at {dask}{which}: 'dask scheduler' starts one and prints its address"
            ) from None
        try:
            with _reporting_lost_connection():
                _require_workers(client)
                yield client
        finally:
            client.close()


def _require_address(address: str) -> None:
    """Refuse what is no address: a client that cannot be made prints a traceback when it is deleted."""
    from distributed.comm.addressing import get_address_host_port

    try:
        get_address_host_port(address)
    except ValueError:
        raise ClusterError(
            f"'{address}' is no address of a scheduler, such as tcp://10.0.0.1:8786: 'dask scheduler' prints its own"
        ) from None


def _security_for(address: str) -> Security:
    """Certificates of dask's own configuration, without which nothing goes to an address that asks for them."""
    from distributed import Security

    security = Security()
    if not address.startswith("tls://"):
        return security
    given = {"ca-file": security.tls_ca_file, "client.cert": security.tls_client_cert}
    missing = [f"distributed.comm.tls.{name}" for name, value in given.items() if not value]
    if missing:
        raise ClusterError(f"{address} needs certificates: dask's configuration has no {' and no '.join(missing)}")
    try:
        security.get_connection_args("client")
    except (OSError, ValueError) as error:
        raise ClusterError(f"the certificates for {address} cannot be used: {error}") from None
    # Once certificates are there, nobody may talk to this process without them.
    security.require_encryption = True
    return security


def dashboard(client: Client) -> str | None:
    """Address of the scheduler's page, where it has one (it needs bokeh)."""
    return client.dashboard_link if "dashboard" in client.scheduler_info().get("services", {}) else None


def threads_of_workers(client: Client) -> dict[str, int]:
    """Threads of every worker that is there now, by address."""
    workers = client.scheduler_info(n_workers=-1)["workers"]
    return {address: int(worker["nthreads"]) for address, worker in workers.items()}


def use_threads_of_worker() -> None:
    """Have computations of this worker use as many threads as it has; to be called before the first of them."""
    from distributed import get_worker

    os.environ.setdefault("RAYON_NUM_THREADS", str(get_worker().state.nthreads))


def submit(client: Client, function: Callable, *arguments: object, address: str | None = None) -> Future:
    """Task that is meant for the worker at an address, and goes to any other if that one is gone."""
    workers = None if address is None else [address]
    with warnings.catch_warnings():
        # The scheduler keeps what a task needs, to give it to workers that join or replace others.
        warnings.filterwarnings("ignore", "Sending large graph")
        return client.submit(function, *arguments, workers=workers, allow_other_workers=address is not None, pure=False)


def spread(client: Client, waiting: list[Item], start: Callable[[Item, str], Future]) -> Iterator[tuple[Item, Future]]:
    """Have items worked on, from the last of the list on; yield each with its task once that has ended.

    ``start`` makes the task of an item for the worker at an address. Every worker is kept in work and one task ahead;
    the rest waits here for workers that join. What a worker that dies has not finished goes to others. Items may be
    added while this goes on. Tasks that are left when the caller stops are cancelled. Raises ClusterError when the
    scheduler is lost.
    """
    running: dict[Future, tuple[Item, str]] = {}
    alone = False
    try:
        while waiting or running:
            threads = threads_of_workers(client)
            if not threads and not alone:
                print("palpate: no worker is left; waiting for one (Ctrl-C keeps what is finished)", file=sys.stderr)
            alone = not threads
            meant = Counter(address for _, address in running.values())
            while waiting and threads:
                address = min(threads, key=lambda address: (meant[address] + 1) / threads[address])
                if meant[address] > threads[address]:
                    break
                item = waiting.pop()
                running[start(item, address)] = item, address
                meant[address] += 1
            for future in wait_for_some(client, list(running)):
                item, _ = running.pop(future)
                if future.status == "cancelled":
                    require_scheduler(client)
                    waiting.append(item)
                else:
                    yield item, future
    finally:
        client.cancel(list(running))


def wait_for_some(client: Client, futures: list[Future]) -> list[Future]:
    """Those that have ended, as soon as one has, or none after a while; with none given, wait for a worker to come.

    Raises ClusterError when the scheduler is lost.
    """
    from distributed import CancelledError, wait

    try:
        if futures:
            with client.as_current():
                wait(futures, timeout=POLL_SECONDS, return_when="FIRST_COMPLETED")
        else:
            client.wait_for_workers(1, timeout=POLL_SECONDS)
    except (TimeoutError, CancelledError):
        require_scheduler(client)
    return [future for future in futures if future.done()]


def require_scheduler(client: Client) -> None:
    """Raise ClusterError if the scheduler is gone."""
    if client.status != "running":
        raise _connection_lost_error()


def result_of(client: Client, future: Future) -> Any:
    """Take the result of a task that has ended; one that was lost with its worker is computed again, and waited for.

    Raises what the task itself raised, and ClusterError if it failed for want of workers or of the same version of
    Palpate, or if the scheduler is lost. The result comes from there: the library would wait for it for ever.
    """
    patience = CONNECT_SECONDS
    while True:
        try:
            return future.result(timeout=patience)
        except Exception as error:
            if future.status == "error":
                raise _failure(future) from None
            if not isinstance(error, TimeoutError):
                raise
            require_scheduler(client)
            patience *= 2  # large results take longer


def _failure(future: Future) -> Exception:
    """Say why a task failed, as an error of Palpate where that can be."""
    from distributed.scheduler import KilledWorker

    error = future.exception()
    if isinstance(error, KilledWorker):
        return ClusterError(
            "several workers ended during the same task, probably because memory ran out: give them more, or fewer "
            "threads, or --memory"
        )
    if isinstance(error, ImportError):
        return ClusterError(f"a worker cannot load Palpate {_native.__version__}: {error}")
    return error if isinstance(error, Exception) else ClusterError(f"a task failed: {error}")


def _require_workers(client: Client) -> None:
    """Refuse a cluster of nobody, and one of another version."""
    try:
        client.wait_for_workers(1, timeout=CONNECT_SECONDS)
    except TimeoutError:
        raise ClusterError(
            f"the scheduler at {client.scheduler.address} has no worker: 'dask worker {client.scheduler.address}' "
            "starts one"
        ) from None

    # Defined here, so that it travels by value: a worker without Palpate can still run it.
    def version() -> str | None:
        try:
            from palpate import _native
        except ImportError:
            return None
        return _native.__version__

    for address, found in client.run(version).items():
        require_version(found, address)


def require_version(found: str | None, address: str) -> None:
    """Raise ClusterError for another version than this process has: its blocks may be of other columns."""
    if found != _native.__version__:
        version_text = "no Palpate" if found is None else f"Palpate {found}"
        raise ClusterError(
            f"the worker at {address} has {version_text}, not {_native.__version__}: install the same version"
        )


def _connection_lost_error() -> ClusterError:
    return ClusterError(
        "the connection to the scheduler is lost; finished blocks are kept, and the same command continues from there"
    )


@contextlib.contextmanager
def _reporting_lost_connection() -> Iterator[None]:
    """Turn errors of the library after the scheduler was lost into one clear error."""
    from distributed import CancelledError
    from distributed.client import ClosedClientError

    try:
        yield
    except (CancelledError, ClosedClientError):
        raise _connection_lost_error() from None
    except OSError as error:
        # Not one of files, here or in what the caller does meanwhile.
        modules = (frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(error.__traceback__))
        if any(name.startswith("distributed.") for name in modules):
            raise _connection_lost_error() from None
        raise


@contextlib.contextmanager
def _muted_library_log() -> Iterator[None]:
    """Keep the library's own account of a failed connection from the terminal: the error says it in a line."""
    # The library gives its client a level of its own.
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)
