"""The API's own page, from files of this package: nothing is loaded from elsewhere."""

from __future__ import annotations

import secrets
from importlib import resources
from pathlib import Path

from fastapi import APIRouter, FastAPI, Response

from shadowbench.service import rendering
from shadowbench.service.problems import Problem

_FILES = {"swagger-ui.css": "text/css", "swagger-ui-bundle.js": "text/javascript", "LICENSE": "text/plain"}


def install(app: FastAPI) -> None:
    """Add the routes to the application."""
    routes = APIRouter(include_in_schema=False)
    routes.add_api_route("/api/docs", page)
    routes.add_api_route("/api/docs/{name}", file)
    app.include_router(routes)


def page() -> Response:
    """Return the page, whose scripts have a nonce of this answer."""
    nonce = secrets.token_urlsafe(16)
    policy = (
        f"default-src 'none'; connect-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; "
        f"script-src 'nonce-{nonce}'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    headers = {"Content-Security-Policy": policy, "Cache-Control": "no-store"}
    return Response(rendering.render("docs.html", nonce=nonce), headers=headers, media_type="text/html; charset=utf-8")


def file(name: str) -> Response:
    """Return one of its files."""
    if name not in _FILES:
        raise Problem(404, "there is no such file")
    content = Path(str(resources.files("shadowbench.service"))).joinpath("static", "swagger-ui", name).read_bytes()
    headers = {"Cache-Control": "public, max-age=86400"}
    return Response(content, headers=headers, media_type=_FILES[name])
