"""What it takes to talk to a cluster: the optional package, an address, and certificates."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from shadowbench.errors import UsageError
from shadowbench.runner.cases import ClusterAccess

if TYPE_CHECKING:
    from distributed.security import Security

DEFAULT_PORT = 8786

QUIET: dict[str, Any] = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.low-level-log-length": 100,
    "distributed.comm.retry.count": 0,
}
"""Dask's own bookkeeping, cut down: no sampling of stacks, few wake-ups beside what is being timed."""


def require_distributed() -> None:
    """Check that the optional package is there.

    Raises:
        UsageError: It is not.
    """
    if importlib.util.find_spec("distributed") is None:
        raise UsageError("a cluster needs dask.distributed: pip install 'shadowbench[cluster]'")


def checked_access(access: ClusterAccess) -> ClusterAccess:
    """Return an access whose address names its protocol.

    Raises:
        UsageError: The address cannot be one, or certificates are missing.
    """
    protocol, separator, rest = access.address.rpartition("://")
    has_tls = any((access.tls_ca, access.tls_cert, access.tls_key))
    protocol = protocol if separator else "tls" if has_tls else "tcp"
    host, _, port = rest.rpartition(":")
    if protocol not in ("tcp", "tls") or not host or not port.isdecimal() or int(port) > 65535:
        raise UsageError(
            f"'{access.address}' is no scheduler's address; it should look like tcp://127.0.0.1:{DEFAULT_PORT} or "
            f"tls://HOST:{DEFAULT_PORT}"
        )
    if has_tls:
        if protocol != "tls":
            raise UsageError(f"certificates are given, but {access.address} is not tls://")
        for option, file in (("ca", access.tls_ca), ("cert", access.tls_cert), ("key", access.tls_key)):
            if file is None:
                raise UsageError(f"--tls-{option} is missing: TLS needs --tls-ca, --tls-cert and --tls-key")
            if not file.is_file():
                raise UsageError(f"--tls-{option} {file}: there is no such file")
    return ClusterAccess(f"{protocol}://{rest}", access.tls_ca, access.tls_cert, access.tls_key)


def security_of(access: ClusterAccess) -> Security:
    """Return dask's description of the certificates; without any, what dask's own configuration says.

    Raises:
        UsageError: TLS is asked for and nobody names certificates, or a file is none.
    """
    import ssl

    from distributed.security import Security

    given: dict[str, Any] = {}
    if access.tls_ca is not None:
        cert, key = str(access.tls_cert), str(access.tls_key)
        given = {"tls_ca_file": str(access.tls_ca), "require_encryption": True}
        for role in ("client", "worker", "scheduler"):
            given |= {f"tls_{role}_cert": cert, f"tls_{role}_key": key}
    security = Security(**given)
    if access.address.startswith("tls://"):
        try:
            context = security.get_connection_args("client")["ssl_context"]
        except (OSError, ssl.SSLError) as error:
            raise UsageError(f"the TLS files cannot be used: {error}") from None
        if context is None:
            raise UsageError("tls:// needs --tls-ca, --tls-cert and --tls-key, or dask's own configuration of them")
    return security


@contextmanager
def quiet_dask() -> Iterator[None]:
    """Hold dask to what this program needs, and keep its log off the terminal."""
    import logging

    import dask
    import distributed  # noqa: F401 - adds its defaults to what is changed and restored here

    for name in ("distributed", "tornado", "bokeh", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    with dask.config.set({**QUIET, "logging": dict.fromkeys(("distributed", "tornado"), "critical")}):
        yield
