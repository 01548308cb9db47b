"""Who may do what, and how often: tokens by scope, requests and wrong tokens by address.

A token is sent as ``Authorization: Bearer sb_…``. Where reading needs one, browsers may send it as the password of
``Basic`` authentication, for reading only: browsers add that by themselves, so it must not be able to change anything.
Nothing depends on cookies.
"""

from __future__ import annotations

import base64
import binascii
from dataclasses import dataclass

from fastapi import Request
from starlette.types import ASGIApp, Receive, Send
from starlette.types import Scope as AsgiScope

from shadowbench.service.buckets import Buckets
from shadowbench.service.problems import Problem
from shadowbench.store.tokens import Scope, Token, TokenBook
from shadowbench.store.uploads import Uploader


class RateMiddleware:
    """Refuses with 429 whoever asks too often."""

    def __init__(self, app: ASGIApp, buckets: Buckets | None) -> None:
        self.app = app
        self.buckets = buckets

    async def __call__(self, scope: AsgiScope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] == "http" and self.buckets is not None and scope["path"] != "/healthz":
            seconds = self.buckets.wait(scope["client"][0] if scope.get("client") else "")
            if seconds > 0.0:
                await _too_often(seconds)(scope, receive, send)
                return
        await self.app(scope, receive, send)


def _too_often(seconds: float) -> ASGIApp:
    from starlette.responses import JSONResponse

    detail = f"too many requests from this address; try again in {seconds:.0f} s or more"
    problem = {"type": "about:blank", "title": "Too Many Requests", "status": 429, "detail": detail}
    headers = {"Retry-After": str(int(seconds) + 1)}
    return JSONResponse(problem, 429, headers, media_type="application/problem+json")


@dataclass(frozen=True)
class Access:
    """Whoever asks: a token, or nobody in particular where reading is open."""

    token: Token | None
    address: str

    @property
    def uploader(self) -> Uploader:
        """Who uploads; only for requests that needed a token."""
        assert self.token is not None
        return Uploader(self.token.token_id, self.address, may_replace=self.token.scope is Scope.ADMIN)


class Doorkeeper:
    """Checks the tokens of requests."""

    def __init__(self, book: TokenBook, *, open_reading: bool, wrong_tokens: Buckets) -> None:
        self._book = book
        self._open_reading = open_reading
        self._wrong = wrong_tokens

    def admit(self, request: Request, scope: Scope) -> Access:
        """Return who asks.

        Raises:
            Problem: The token is missing, wrong or not good for this; or too many wrong ones came from the address.
        """
        address = request.client.host if request.client else ""
        text = _sent_token(request.headers.get("authorization", ""), basic=scope is Scope.READ)
        if text is None:
            if scope is Scope.READ and self._open_reading:
                return Access(None, address)
            raise self._unauthorized("a token is needed", scope)
        seconds = self._wrong.wait(address, take=0.0)
        if seconds > 0.0:
            detail = "too many wrong tokens from this address"
            raise Problem(429, detail, headers={"Retry-After": str(int(seconds) + 1)})
        token = self._book.check(text)
        if token is None:
            self._wrong.wait(address)
            raise self._unauthorized("the token is not valid: wrong, expired or revoked", scope)
        if not token.scope.includes(scope):
            raise Problem(403, f"the token has the scope '{token.scope}'; this needs '{scope}'")
        request.state.token_id = token.token_id
        return Access(token, address)

    def _unauthorized(self, detail: str, scope: Scope) -> Problem:
        challenge = (
            'Basic realm="shadowbench", charset="UTF-8"' if scope is Scope.READ else 'Bearer realm="shadowbench"'
        )
        return Problem(401, detail, headers={"WWW-Authenticate": challenge})


def _sent_token(header: str, *, basic: bool) -> str | None:
    """Return the token of an ``Authorization`` header, ``None`` without one; what is none at all is empty."""
    if not header:
        return None
    kind, _, content = header.partition(" ")
    if kind.lower() == "bearer":
        return content.strip()
    if kind.lower() == "basic" and basic:
        try:
            return base64.b64decode(content.strip(), validate=True).decode("utf-8").partition(":")[2]
        except (binascii.Error, UnicodeDecodeError):
            return ""
    return ""
