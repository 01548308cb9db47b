"""The process: it says where it listens, serves until it is told to stop, and lets what it has begun end first."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import uvicorn

from shadowbench.errors import UsageError
from shadowbench.service import telemetry
from shadowbench.service.app import create_app
from shadowbench.service.settings import ENVIRONMENT, Settings, is_public
from shadowbench.store import Store
from shadowbench.store.tokens import Scope, TokenBook

_PATIENCE_S = 30
_MOST_AT_ONCE = 512


def serve(settings: Settings, host: str, port: int, workers: int, *, is_proxied: bool) -> None:
    """Serve until the process is asked to stop (SIGTERM or SIGINT).

    Args:
        settings: How.
        host, port: Where; 0 for any port that is free.
        workers: How many processes.
        is_proxied: Whether a proxy on this machine says, in ``X-Forwarded-For``, who asks.

    Raises:
        UsageError: The address is public and no token guards it.
        StoreError: The results cannot be opened.
    """
    with Store.open(settings.results, database=settings.database) as store:  # upgrades it, once for all workers
        if is_public(host) and not TokenBook(store).any_valid(Scope.UPLOAD if settings.open_reading else Scope.READ):
            raise UsageError(
                f"--host {host} can be reached by others, and there is no valid token; make one first:"
                " shadowbench token create --name NAME"
            )
    options = {
        "host": host,
        "port": port,
        "log_config": None,
        "access_log": False,
        "server_header": False,
        "proxy_headers": is_proxied,
        "timeout_graceful_shutdown": _PATIENCE_S,
        "limit_concurrency": _MOST_AT_ONCE,
    }
    if workers == 1:
        telemetry.log_to_stderr()
        uvicorn.run(create_app(settings, keeps_apart=True), **options)  # type: ignore[arg-type]
        return
    with tempfile.TemporaryDirectory(prefix="shadowbench-serve-") as folder:
        counters = Path(folder) / "counters"
        counters.mkdir()
        os.environ[telemetry.MULTIPROCESS] = str(counters)
        os.environ[ENVIRONMENT] = settings.model_copy(update={"shared": Path(folder)}).as_text()
        telemetry.log_to_stderr()
        uvicorn.run("shadowbench.service.app:from_environment", factory=True, workers=workers, **options)  # type: ignore[arg-type]
