"""Errors as ``application/problem+json`` (RFC 9457), or as a page for whoever asked for one.

A problem says what was wrong and, where it lies in what was sent, at which ``place``. What a fault of the program
itself was is in the log, under the number that the answer names.
"""

from __future__ import annotations

import json
import logging
import secrets
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException

from shadowbench.errors import ShadowbenchError, StorageFullError, StoreError
from shadowbench.service import rendering
from shadowbench.store.documents import DocumentError
from shadowbench.store.uploads import ConflictError, MissingArtifactsError

MEDIA_TYPE = "application/problem+json"

_LOG = logging.getLogger("shadowbench.service")


class Problem(HTTPException):
    """A request that cannot be answered."""

    def __init__(self, status: int, detail: str, *, headers: dict[str, str] | None = None, **members: Any) -> None:
        """State a problem.

        Args:
            status: The status code.
            detail: What is wrong, and what would be right.
            headers: Of the answer.
            members: Further members of the JSON object, such as ``place``.
        """
        super().__init__(status, detail, headers)
        self.members = members


def install(app: FastAPI) -> None:
    """Let every error of an application leave it as a problem."""

    async def http(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        members = error.members if isinstance(error, Problem) else {}
        is_nowhere = error.status_code == HTTPStatus.NOT_FOUND and error.detail == HTTPStatus.NOT_FOUND.phrase
        detail = "there is nothing at this address" if is_nowhere else error.detail
        return _answer(request, error.status_code, detail, members, dict(error.headers or {}))

    async def invalid(request: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        fault = error.errors()[0]
        place = ".".join(map(str, fault["loc"]))
        return _answer(request, 422, f"{place}: {fault['msg']}", {"place": place}, {})

    async def ours(request: Request, error: Exception) -> Response:
        return _of_store(request, error)

    async def unforeseen(request: Request, error: Exception) -> Response:
        number = secrets.token_hex(6)
        _LOG.error("fault %s", number, exc_info=error)
        return _answer(request, 500, f"a fault of the service; its log knows more under {number}", {}, {})

    app.add_exception_handler(HTTPException, http)
    app.add_exception_handler(RequestValidationError, invalid)
    app.add_exception_handler(ShadowbenchError, ours)
    app.add_exception_handler(Exception, unforeseen)


def _of_store(request: Request, error: Exception) -> Response:
    if isinstance(error, DocumentError):
        return _answer(request, 422, str(error), {"place": error.place}, {})
    if isinstance(error, MissingArtifactsError):
        return _answer(request, 409, str(error), {"missing": error.names}, {})
    if isinstance(error, ConflictError):
        return _answer(request, 409, str(error), {}, {})
    # what the store says names folders of the server: it is the operator's to read
    number = secrets.token_hex(6)
    _LOG.error("store %s: %s", number, error)
    if isinstance(error, StorageFullError):
        return _answer(request, 507, "there is no room left where results are kept; nothing was changed", {}, {})
    if isinstance(error, StoreError):
        detail = f"the results cannot be reached just now; the log knows more under {number}"
        return _answer(request, 503, detail, {}, {"Retry-After": "5"})
    return _answer(request, 500, f"a fault of the service; its log knows more under {number}", {}, {})


def _answer(request: Request, status: int, detail: str, members: dict[str, Any], headers: dict[str, str]) -> Response:
    try:
        title = HTTPStatus(status).phrase
    except ValueError:
        title = "Error"
    headers = headers | {"Cache-Control": "no-store"}
    if _wants_page(request):
        text = rendering.render("problem.html", title=title, status=status, detail=detail)
        return Response(text, status, headers | rendering.HEADERS, "text/html; charset=utf-8")
    document = {"type": "about:blank", "title": title, "status": status, "detail": detail} | members
    return Response(json.dumps(document), status, headers, MEDIA_TYPE)


def _wants_page(request: Request) -> bool:
    path = request.url.path
    if path.startswith(("/api/", "/artifacts/", "/healthz", "/metrics")) or path.endswith((".json", ".csv")):
        return False
    return "text/html" in request.headers.get("accept", "")
