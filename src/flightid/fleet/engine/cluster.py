"""Logs on a Dask cluster: one that is made for this machine, or one that exists, by its address."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any
from urllib.parse import urlsplit

from flightid.conventions import Light
from flightid.errors import DataError, FlightidError, OptionError
from flightid.extras import extra_module
from flightid.findings import Finding
from flightid.fleet.engine.interrupts import interrupts_held
from flightid.fleet.engine.order import KILLED, LogOrder, LogOutcome, RunOrder
from flightid.fleet.engine.plain import WINDOW, machine_workers
from flightid.fleet.engine.sandbox import DEAD, Sandbox

PURPOSE = "a cluster for a fleet"
LOOPBACK = {"localhost", "127.0.0.1", "::1", "[::1]"}
SETTINGS = {
    # One try elsewhere where a worker dies; then the log is named, and tried alone.
    "distributed.scheduler.allowed-failures": 1,
    # A worker holds what it does and no more: a log that hangs holds up no other.
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.worker.daemon": False,
    "distributed.worker.memory.terminate": False,
    "distributed.worker.memory.pause": False,
    # What a waiting worker costs: it profiles itself every 10 ms otherwise.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "200ms",
    "distributed.admin.system-monitor.interval": "5s",
    # The port for pages opens whether there are any or not: nothing is served there.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}
SILENCE_S = 10.0
"""Time without a result after which the workers are counted."""
PATIENCE = 6
"""Counts without any worker until the run is given up."""
NAME = "flightid-fleet"


class SandboxPlugin:
    """What a worker of the cluster keeps: one sandbox, made anew with every worker.

    Parameters
    ----------
    order : RunOrder
    """

    name = NAME
    idempotent = False

    def __init__(self, order: RunOrder) -> None:
        self.order = order
        self.sandbox: Sandbox | None = None

    def setup(self, worker: object) -> None:
        """Called by the worker when it takes the plugin."""
        del worker
        self.sandbox = Sandbox(self.order)

    def teardown(self, worker: object) -> None:
        """Called by the worker when it ends."""
        del worker
        if self.sandbox is not None:
            self.sandbox.close()


def take_log(order: LogOrder) -> LogOutcome:
    """Take one log: the task that workers run."""
    worker = extra_module("distributed", PURPOSE).get_worker()
    outcome: LogOutcome = worker.plugins[NAME].sandbox.run(order)
    return outcome


def scheduler_finding(address: str) -> Finding | None:
    """Warning where tasks go to another machine in the open; None where nothing is to be said."""
    parts = urlsplit(address)
    if parts.scheme == "tcp" and (parts.hostname or "") not in LOOPBACK:
        return Finding(
            "open-scheduler",
            Light.AMBER,
            f"{address} is not encrypted: whoever reaches the port runs code on every worker",
            "give scheduler and workers certificates, and the address as tls://",
        )
    return None


def require_address(address: str) -> None:
    """Refuse what is no address of a scheduler.

    Raises
    ------
    OptionError
        It has another form.
    """
    parts = urlsplit(address)
    if parts.scheme not in ("tcp", "tls", "ws", "wss", "inproc") or not parts.netloc:
        raise OptionError(
            "this is no address of a scheduler", found=address, needed="tls://host:8786"
        )


def run_cluster(
    order: RunOrder,
    logs: Iterable[LogOrder],
    workers: int | None = None,
    scheduler: str | None = None,
) -> Iterator[LogOutcome]:
    """Take logs on a cluster.

    Parameters
    ----------
    order : RunOrder
    logs : iterable of LogOrder
        Taken as room is made: it may be long.
    workers : int, optional
        Of a cluster on this machine; default: one a processor.
    scheduler : str, optional
        Address of one that exists.

    Yields
    ------
    LogOutcome
        As they are done; no finished future is kept.

    Raises
    ------
    DataError
        The cluster is gone. All that was done is in the catalogue.
    """
    distributed = extra_module("distributed", PURPOSE)
    with _client(distributed, workers, scheduler) as client:
        # A later run of the same cluster brings its own order.
        plugin = _plugin(distributed, order)
        try:
            client.register_plugin(plugin, name=NAME)
            yield from _flown(distributed, client, logs)
        except (OSError, TimeoutError, RuntimeError, distributed.CancelledError) as error:
            if isinstance(error, FlightidError):
                raise
            raise _lost(error) from error


def _plugin(distributed: Any, order: RunOrder) -> Any:  # noqa: ANN401 - of an extra's library
    """The plugin as the library wants it: derived from its own class, which an extra installs."""
    kind = type("FleetPlugin", (SandboxPlugin, distributed.WorkerPlugin), {})
    return kind(order)


def _lost(error: BaseException) -> DataError:
    return DataError(
        "the cluster is gone",
        found=f"{type(error).__name__}: {error}"[:300],
        needed="a scheduler with workers",
        action="run the fleet again: what was done is kept, and only the rest is taken",
    )


@contextlib.contextmanager
def _client(distributed: Any, workers: int | None, scheduler: str | None) -> Iterator[Any]:  # noqa: ANN401
    dask = extra_module("dask", PURPOSE)
    with dask.config.set(SETTINGS):
        stack = contextlib.ExitStack()
        try:
            with interrupts_held():
                client = _begun(distributed, stack, workers, scheduler)
            yield client
        finally:
            # Whoever is impatient presses twice: a cluster that ends halfway prints where it stood.
            with interrupts_held():
                stack.close()


def _begun(
    distributed: Any,  # noqa: ANN401 - of an extra's library
    stack: contextlib.ExitStack,
    workers: int | None,
    scheduler: str | None,
) -> Any:  # noqa: ANN401
    """A client of a scheduler, or of a cluster that is made; the stack ends both."""
    if scheduler is None:
        cluster = distributed.LocalCluster(
            n_workers=workers or machine_workers(),
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            # Any free port; 8787 is warned of where a second run takes it.
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
            host="127.0.0.1",
            memory_limit=0,
            silence_logs="ERROR",
        )
        stack.enter_context(cluster)
        scheduler = cluster.scheduler_address
    try:
        client = distributed.Client(scheduler, timeout="30s", set_as_default=False)
    except (OSError, TimeoutError) as error:
        raise OptionError(
            "no scheduler answers",
            found=f"{scheduler}: {error}"[:300],
            needed="the address of one that runs",
            action="start one: dask scheduler; then dask worker ADDRESS on every machine",
        ) from error
    except TypeError as error:  # Of Dask, where tls:// is asked for and no certificate named.
        raise OptionError(
            "no certificate for the scheduler",
            found=f"{scheduler}: {error}"[:300],
            needed="distributed.comm.tls: ca-file, and client.cert and client.key",
            action="name them in Dask's configuration, or in DASK_DISTRIBUTED__COMM__TLS__…",
        ) from error
    stack.enter_context(client)
    stack.enter_context(client.as_current())
    return client


def _flown(distributed: Any, client: Any, logs: Iterable[LogOrder]) -> Iterator[LogOutcome]:  # noqa: ANN401
    """Results as they come, with a window of logs in flight."""
    source = iter(logs)
    flying: dict[Any, LogOrder] = {}
    quiet = 0
    while True:
        room = WINDOW * max(len(client.scheduler_info(n_workers=-1)["workers"]), 1) - len(flying)
        for log in islice(source, max(room, 0)):
            flying[client.submit(take_log, log, pure=False)] = log
        if not flying:
            return
        try:
            done, _ = distributed.wait(
                list(flying), timeout=SILENCE_S, return_when="FIRST_COMPLETED"
            )
        except TimeoutError:
            quiet = 0 if client.scheduler_info(n_workers=-1)["workers"] else quiet + 1
            if quiet >= PATIENCE:
                raise TimeoutError("no worker is left") from None
            continue
        quiet = 0
        for future in done:
            yield _result(distributed, future, flying.pop(future))


def _result(distributed: Any, future: Any, log: LogOrder) -> LogOutcome:  # noqa: ANN401
    try:
        outcome: LogOutcome = future.result()
    except distributed.KilledWorker as error:
        return LogOutcome(log, KILLED, log.address.digest, DEAD, f"its workers died: {error}")
    return outcome
