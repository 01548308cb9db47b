"""The processes of a cluster that a user starts: workers and a scheduler.

A worker has no nanny: a dask worker that dies is not started again behind the client's back, and what dies in a worker
is a process below it. Both listen on one interface only, by default the one that reaches the scheduler.
"""

from __future__ import annotations

import asyncio
import os
import secrets
import socket
import tempfile
from collections.abc import Callable
from pathlib import Path

from shadowbench.errors import ClusterError
from shadowbench.runner.cases import ClusterAccess
from shadowbench.runner.cluster.access import checked_access, quiet_dask, require_distributed, security_of
from shadowbench.runner.cluster.jobs import RESOURCE

CONNECT_TIMEOUT_S = 30.0


def default_folder() -> Path:
    """Return where a worker keeps its cache unless told otherwise."""
    base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "shadowbench" / "worker"


def serve_worker(access: ClusterAccess, folder: Path, host: str | None, tell: Callable[[str], None]) -> None:
    """Be a worker until the scheduler goes away.

    Args:
        access: The scheduler's.
        folder: For the cache of scenes and references, and for plugin files.
        host: Address to listen on.
        tell: Told when it is ready.

    Raises:
        UsageError: The address or the certificates are wrong, or the optional package is missing.
        ClusterError: Nobody answers, or the scheduler went away.
    """
    require_distributed()
    access = checked_access(access)
    folder.mkdir(parents=True, exist_ok=True)
    with quiet_dask(), tempfile.TemporaryDirectory(prefix="shadowbench-") as scratch:
        asyncio.run(_worker(access, folder.absolute(), host, scratch, tell))


async def _worker(
    access: ClusterAccess, folder: Path, host: str | None, scratch: str, tell: Callable[[str], None]
) -> None:
    from distributed import Worker
    from distributed.comm.addressing import get_address_host
    from distributed.utils import get_ip

    from shadowbench.runner.cluster.serving import BenchKeeper

    security = security_of(access)
    try:
        own = host or get_ip(get_address_host(access.address))
        worker = Worker(
            access.address,
            nthreads=1,
            name=f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(3)}",
            resources={RESOURCE: 1},
            memory_limit=0,
            host=own,
            protocol=access.address.partition("://")[0],
            security=security,
            local_directory=scratch,
            plugins=(BenchKeeper(folder),),
            death_timeout=CONNECT_TIMEOUT_S,
        )
        async with worker:
            tell(f"worker {worker.address} of {access.address}, cache in {folder}")
            await worker.finished()
    except (OSError, TimeoutError) as error:
        raise ClusterError(
            f"no scheduler answers at {access.address} within {CONNECT_TIMEOUT_S:g} s; `shadowbench scheduler` starts "
            f"one, and both sides must agree on TLS ({type(error).__name__})"
        ) from error
    raise ClusterError(f"the scheduler at {access.address} went away")


def serve_scheduler(access: ClusterAccess, tell: Callable[[str], None]) -> None:
    """Be a scheduler until interrupted.

    Args:
        access: Where to listen, port 0 for any; with certificates, TLS only.
        tell: Told when it is ready, and where.

    Raises:
        UsageError: The address or the certificates are wrong, or the optional package is missing.
        ClusterError: The address cannot be listened on.
    """
    require_distributed()
    access = checked_access(access)
    with quiet_dask():
        asyncio.run(_scheduler(access, tell))


async def _scheduler(access: ClusterAccess, tell: Callable[[str], None]) -> None:
    from distributed import Scheduler

    protocol, _, rest = access.address.partition("://")
    host, _, port = rest.rpartition(":")
    security = security_of(access)
    try:
        scheduler = Scheduler(
            host=host,
            port=int(port),
            protocol=protocol,
            security=security,
            dashboard=False,
            dashboard_address=f"{host}:0",
        )
        async with scheduler:
            tell(f"scheduler {scheduler.address}")
            await scheduler.finished()
    except OSError as error:
        raise ClusterError(f"cannot listen on {access.address}: {error.strerror or error}") from error
