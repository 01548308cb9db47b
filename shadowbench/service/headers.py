"""Headers of every answer: what a browser must not do with it, and in which names it may be asked for.

Pages have one style and one script, both inside the page and named by their hashes, so that nothing else can run or
load, whatever got into a page. Hashes rather than a nonce: a page is then the same for every reader and can be kept by
its ETag. The page of the API's documentation, whose script is a large file, has a nonce.
"""

from __future__ import annotations

from collections.abc import Sequence

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

NOTHING = "default-src 'none'; frame-ancestors 'none'"
"""The policy of whatever is no page."""

_HEADERS = {
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}

_CHANGING = frozenset({"POST", "PUT", "PATCH", "DELETE"})


class GuardMiddleware:
    """Adds the headers; refuses names that are not ours and changes that another site's page asks for."""

    def __init__(self, app: ASGIApp, hosts: Sequence[str]) -> None:
        self.app = app
        self.hosts = frozenset(host.lower() for host in hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
                headers.setdefault("content-security-policy", NOTHING)
            await send(message)

        refusal = self._refusal(Headers(scope=scope), scope["method"])
        if "\0" in scope["path"] or b"%00" in scope["query_string"]:
            refusal = 400, "the address holds a NUL character"
        if refusal is None:
            await self.app(scope, receive, send_guarded)
            return
        status, detail = refusal
        problem = {"type": "about:blank", "title": "Refused", "status": status, "detail": detail}
        answer = JSONResponse(problem, status, media_type="application/problem+json")
        await answer(scope, receive, send_guarded)

    def _refusal(self, headers: Headers, method: str) -> tuple[int, str] | None:
        host = headers.get("host", "").lower()
        name = host.rpartition(":")[0] if ":" in host and not host.endswith("]") else host
        if "*" not in self.hosts and name not in self.hosts:
            return 421, "the service is not known under this name; an operator adds it with --allow-host"
        if method in _CHANGING and headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return 403, "pages of other sites may not change anything here"
        return None
