"""The application: middleware, routes and errors put together."""

from __future__ import annotations

import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import Depends, FastAPI, Request, Response
from fastapi.responses import JSONResponse
from starlette.middleware.gzip import GZipMiddleware

import shadowbench
from shadowbench.service import documentation, pages, problems, rendering, schemas, telemetry, uploads
from shadowbench.service.access import Access, Doorkeeper, RateMiddleware
from shadowbench.service.buckets import Buckets
from shadowbench.service.headers import GuardMiddleware
from shadowbench.service.keeping import Keeping, KeepingApart
from shadowbench.service.settings import ENVIRONMENT, WRONG_TOKENS_A_SECOND, Settings
from shadowbench.store import Store
from shadowbench.store.catalogue import Catalogue
from shadowbench.store.tokens import Scope, TokenBook

_DESCRIPTION = """Runs of shadowbench: read them, compare them, upload them.

Reading may be open to all; uploading takes a token, sent as `Authorization: Bearer sb_…`. Errors are
`application/problem+json` (RFC 9457)."""


def create_app(settings: Settings, *, keeps_apart: bool = False) -> FastAPI:
    """Return the application for a results folder, which is made, or upgraded, if need be.

    Args:
        settings: How it behaves.
        keeps_apart: Whether a process beside this one keeps what is uploaded, so that readers need not wait for it.

    Raises:
        StoreError: The results cannot be opened.
    """
    store = Store.open(settings.results, database=settings.database)
    catalogue = Catalogue(store)
    keeper = KeepingApart(settings) if keeps_apart else Keeping(store, settings.most_pixels)

    def buckets(rate: float, burst: int, name: str) -> Buckets:
        return Buckets(rate, burst, None if settings.shared is None else settings.shared / name)

    asking = buckets(settings.requests_a_second, settings.burst, "asking") if settings.requests_a_second else None
    guessing = buckets(WRONG_TOKENS_A_SECOND, settings.wrong_tokens, "guessing")

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        keeper.close()
        catalogue.close()
        store.close()

    app = FastAPI(
        title=settings.title,
        version=shadowbench.__version__,
        description=_DESCRIPTION,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
        swagger_ui_oauth2_redirect_url=None,
    )
    seen = telemetry.Telemetry()
    rendering.use_title(settings.title)
    doorkeeper = Doorkeeper(TokenBook(store), open_reading=settings.open_reading, wrong_tokens=guessing)

    def reader(request: Request) -> Access:
        return doorkeeper.admit(request, Scope.READ)

    def uploader(request: Request) -> Access:
        return doorkeeper.admit(request, Scope.UPLOAD)

    @app.get(
        "/healthz",
        tags=["operate"],
        summary="alive?",
        responses={200: {"description": "It is.", "content": schemas.content(schemas.Health)}},
    )
    def healthz() -> Response:
        """Whether the service runs and reaches its database."""
        catalogue.version()
        return JSONResponse({"status": "ok", "version": shadowbench.__version__}, headers={"Cache-Control": "no-store"})

    @app.get("/metrics", include_in_schema=False, dependencies=[Depends(reader)])
    def metrics() -> Response:
        """Counters for Prometheus."""
        return Response(seen.text(), media_type="text/plain; version=0.0.4; charset=utf-8")

    problems.install(app)
    documentation.install(app)
    uploads.install(app, store, keeper, settings, seen, uploader)
    pages.install(app, store, catalogue, settings, reader)
    schemas.install(app)
    # from the inside out: what is added last sees a request first
    app.add_middleware(GZipMiddleware, minimum_size=1000, compresslevel=5)
    app.add_middleware(RateMiddleware, buckets=asking)
    app.add_middleware(GuardMiddleware, hosts=settings.hosts)
    app.add_middleware(telemetry.TelemetryMiddleware, telemetry=seen)
    return app


def from_environment() -> FastAPI:
    """Return the application that a worker process serves; its settings come through the environment."""
    telemetry.log_to_stderr()
    return create_app(Settings.model_validate_json(os.environ[ENVIRONMENT]), keeps_apart=True)
