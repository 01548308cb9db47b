"""Routes for uploading: which pictures are missing, a picture, a run. Each may be repeated as often as one likes.

A run comes last, in one request and one transaction: nobody ever sees half of one. What a request was answered with 200
or 201 is on the disk.
"""

# no postponed annotations: FastAPI reads one that is a name of install()

import hashlib
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
from shadowbench.service.pages import problem
from shadowbench.service.pictures import PictureError, check_png
from shadowbench.service.problems import Problem
from shadowbench.service.settings import Settings
from shadowbench.service.telemetry import Telemetry
from shadowbench.store import Store
from shadowbench.store.documents import DocumentError, parsed, rows_from_documents, run_from_document
from shadowbench.store.uploads import Kept, digest_of, missing_artifacts, put_picture, put_run

_SUFFIX = ".png"

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
    app: FastAPI, store: Store, settings: Settings, telemetry: Telemetry, uploader: Callable[..., Access]
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
        is_new = await run_in_threadpool(_keep_picture, store, settings, name, content, access)
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
        kept, row_count, digest = await to_thread.run_sync(
            _keep_run, store, run_id, content, access, limiter=one_at_a_time
        )
        telemetry.uploads.labels(kept.value).inc()
        telemetry.rows.inc(row_count if kept is not Kept.UNCHANGED else 0)
        answer = {"run_id": run_id, "kept": kept.value, "row_count": row_count, "digest": digest}
        return JSONResponse(answer, 201 if kept is Kept.CREATED else 200)

    app.include_router(routes)


def _keep_picture(store: Store, settings: Settings, name: str, content: bytes, access: Access) -> bool:
    try:
        store.artifacts.path(name)
    except StoreError as error:
        raise DocumentError("path.name", str(error)) from None
    if not name.endswith(_SUFFIX):
        raise DocumentError("path.name", "is not that of a PNG file: only pictures are taken")
    if hashlib.sha256(content).hexdigest() != name.removesuffix(_SUFFIX):
        raise DocumentError("body", "does not have the SHA-256 of its name")
    try:
        check_png(content, settings.most_pixels)
    except PictureError as error:
        raise DocumentError("body", str(error)) from None
    return put_picture(store, content, access.uploader)


def _keep_run(store: Store, run_id: str, content: bytes, access: Access) -> tuple[Kept, int, str]:
    document = parsed(content, "body")
    if not isinstance(document, dict) or set(document) != {"run", "rows"}:
        raise DocumentError("body", "is not an object with 'run' and 'rows'")
    run = run_from_document(document["run"])
    if run.run_id != run_id:
        raise DocumentError("run.run_id", "is not the id in the address")
    if run.finished_at is None:
        raise Problem(422, "run.finished_at: the run has not ended", place="run.finished_at")
    rows = rows_from_documents(document["rows"], run)
    return put_run(store, run, rows, access.uploader), len(rows), digest_of(run, rows)
