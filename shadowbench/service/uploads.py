"""Routes for uploading: which pictures are missing, a picture, a run. Each may be repeated as often as one likes.

A run comes last, in one request and one transaction: nobody ever sees half of one. What a request was answered with 200
or 201 is on the disk.
"""

# no postponed annotations: FastAPI reads one that is a name of install()

from collections.abc import Callable
from typing import Annotated, Any

from anyio import CapacityLimiter, to_thread
from fastapi import APIRouter, Depends, FastAPI, Request, Response
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool

from shadowbench.errors import StoreError
from shadowbench.service import bodies, schemas
from shadowbench.service.access import Access
from shadowbench.service.keeping import Keeper
from shadowbench.service.pages import problem
from shadowbench.service.settings import Settings
from shadowbench.service.telemetry import Telemetry
from shadowbench.store import Store
from shadowbench.store.documents import DocumentError, parsed
from shadowbench.store.uploads import Kept, missing_artifacts

_PROBLEMS: dict[int | str, dict[str, Any]] = {
    400: problem("The body broke off or is damaged."),
    401: problem("A token is needed, or this one is not valid."),
    403: problem("The token's scope is not `upload`."),
    413: problem("The body is too large."),
    415: problem("The body is packed in another way than gzip."),
    422: problem("The body is not what it should be; `place` says where."),
    429: problem("Too many requests, or too many wrong tokens."),
    503: problem("The results cannot be reached just now."),
    507: problem("There is no room left; nothing was changed."),
}


def _body(content: dict[str, Any]) -> dict[str, Any]:
    return {"requestBody": {"required": True, "content": content}}


def _answer(description: str, model: type[BaseModel]) -> dict[str, Any]:
    return {"description": description, "content": schemas.content(model)}


_PNG = {"image/png": {"schema": {"type": "string", "format": "binary"}}}


def install(
    app: FastAPI,
    store: Store,
    keeper: Keeper,
    settings: Settings,
    telemetry: Telemetry,
    uploader: Callable[..., Access],
) -> None:
    """Add the routes to the application."""
    routes = APIRouter(prefix="/api/v1", tags=["upload"])
    allowed = Annotated[Access, Depends(uploader)]
    # one writes at a time anyway; more of them at work would only keep readers waiting
    one_at_a_time = CapacityLimiter(1)

    @routes.post(
        "/artifacts/missing",
        openapi_extra=_body(schemas.content(schemas.ArtifactNames)),
        responses=_PROBLEMS | {200: _answer("What to send.", schemas.MissingArtifacts)},
        summary="what to send",
        dependencies=[Depends(uploader)],
    )
    async def missing(request: Request) -> Response:
        """Of these names of pictures, which the service does not have yet."""
        document = parsed(await bodies.read(request, settings.largest_body), "body")
        names = document.get("names") if isinstance(document, dict) else None
        if (
            not isinstance(names, list)
            or not all(isinstance(name, str) for name in names)
            or len(names) > schemas.MOST_NAMES
        ):
            raise DocumentError("body.names", f"is not a list of up to {schemas.MOST_NAMES} names")
        try:
            return JSONResponse({"missing": await run_in_threadpool(missing_artifacts, store, names)})
        except StoreError as error:
            raise DocumentError("body.names", str(error)) from None

    @routes.put(
        "/artifacts/{name}",
        status_code=201,
        openapi_extra=_body(_PNG),
        responses=_PROBLEMS
        | {
            200: _answer("It was there already.", schemas.KeptPicture),
            201: _answer("It is kept.", schemas.KeptPicture),
        },
        summary="send a picture",
    )
    async def picture(request: Request, name: str, access: allowed) -> Response:
        """A PNG file under its name, `<sha256>.png`."""
        content = await bodies.read(request, settings.largest_picture)
        is_new = await to_thread.run_sync(keeper.keep_picture, name, content, access.uploader, limiter=one_at_a_time)
        return JSONResponse({"name": name}, 201 if is_new else 200)

    @routes.put(
        "/runs/{run_id}",
        status_code=201,
        openapi_extra=_body(schemas.content(schemas.RunUpload)),
        responses=_PROBLEMS
        | {
            200: _answer(
                "It was there already, or took the place of an earlier upload with the same token.", schemas.KeptRun
            ),
            201: _answer("It is kept.", schemas.KeptRun),
            409: problem("Pictures are `missing`, or another run has this id."),
        },
        summary="send a run",
    )
    async def run(request: Request, run_id: str, access: allowed) -> Response:
        """A run and all its rows, once its pictures are there."""
        content = await bodies.read(request, settings.largest_body)
        found = await to_thread.run_sync(keeper.keep_run, run_id, content, access.uploader, limiter=one_at_a_time)
        telemetry.uploads.labels(found.kept.value).inc()
        telemetry.rows.inc(found.row_count if found.kept is not Kept.UNCHANGED else 0)
        answer = {"run_id": run_id, "kept": found.kept.value, "row_count": found.row_count, "digest": found.digest}
        return JSONResponse(answer, 201 if found.kept is Kept.CREATED else 200)

    app.include_router(routes)
