"""The API's own page and the site's icon, from files of this package: nothing is loaded from elsewhere."""

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
    routes.add_api_route("/favicon.ico", icon)
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
    return _static(f"swagger-ui/{name}", _FILES[name])


def icon() -> Response:
    """Return the picture that browsers show beside a page's title."""
    return _static("icon.svg", "image/svg+xml")


def _static(name: str, media_type: str) -> Response:
    content = Path(str(resources.files("shadowbench.service"))).joinpath("static", name).read_bytes()
    return Response(content, headers={"Cache-Control": "public, max-age=86400"}, media_type=media_type)
