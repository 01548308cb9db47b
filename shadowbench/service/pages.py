"""Routes for readers: every page, and the same as ``.json`` and ``.csv``; the API's own names for them; pictures."""

from __future__ import annotations

import functools
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Annotated, Any

from fastapi import APIRouter, Depends, FastAPI, Query, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from shadowbench.errors import StoreError
from shadowbench.service import answers, histories, schemas, standings
from shadowbench.service.access import Access
from shadowbench.service.pictures import PictureError, encoded_again
from shadowbench.service.problems import Problem
from shadowbench.service.reports import Reports
from shadowbench.service.responding import Answer, Answers
from shadowbench.service.settings import Settings
from shadowbench.store import Store
from shadowbench.store.catalogue import Catalogue, RunFilter

FORMS = ("html", "json", "csv")

_PICTURE_BYTES = 64 * 2**20
_LONGEST = 300

Text = Annotated[str, Query(max_length=_LONGEST)]


def install(
    app: FastAPI, store: Store, catalogue: Catalogue, settings: Settings, reader: Callable[..., Access]
) -> None:
    """Add the routes to the application."""
    kept = Answers(catalogue.version, settings.cached_answers)
    routes = _Routes(store, catalogue, settings, kept)
    pages = APIRouter(dependencies=[Depends(reader)])
    pages.add_api_route("/", routes.first, include_in_schema=False)
    for path, name in _PAGES.items():
        for form in FORMS[::-1]:  # names that end in .json or .csv come before the ones that may hold anything
            said = _CHOOSING.get(name, name) if form == "html" else name
            make = functools.partial(getattr(routes, said), form=form)
            shown = path if form == "html" else f"{path}.{form}"
            pages.add_api_route(shown, _named(make, f"{name}_{form}"), include_in_schema=False)
    for path, name in _API.items():
        for form in ("csv", "json"):
            make = functools.partial(getattr(routes, name), form=form)
            shown = f"/api/v1{path}" if form == "json" else f"/api/v1{path}.csv"
            documented = _named(make, f"{name}_{form}")
            text = "the same as JSON" if form == "json" else "the same as CSV"
            pages.add_api_route(
                shown,
                documented,
                description=f"{_meaning(getattr(routes, name))} ({text}).",
                summary=f"{name.replace('_', ' ')} ({form})",
                tags=["read"],
                responses=_READ_RESPONSES[form] | ({200: _as_json(name)} if form == "json" else {}),
                response_class=Response,
            )
    pages.add_api_route("/runs/{run_id}/report", routes.report, include_in_schema=False)
    pages.add_api_route(
        "/artifacts/{name}",
        routes.picture,
        tags=["read"],
        summary="picture",
        response_class=Response,
        responses={200: _PICTURE, **_PROBLEMS},
    )
    app.include_router(pages)


_PAGES = {
    "/runs": "runs",
    "/runs/{run_id}": "run",
    "/runs/{run_id}/claims": "claims",
    "/runs/{run_id}/cases/{case_key:path}": "case",
    "/experiments": "experiments",
    "/experiments/{experiment:path}": "leaderboard",
    "/methods": "methods",
    "/methods/{method:path}": "history",
    "/machines": "machines",
    "/compare": "compare",
}

_CHOOSING = {"compare": "choose"}
"""Pages that let a reader choose what JSON and CSV must be told."""

_API = {
    "/runs": "runs",
    "/runs/{run_id}": "run",
    "/runs/{run_id}/claims": "claims",
    "/runs/{run_id}/cases/{case_key:path}": "case",
    "/experiments": "experiments",
    "/experiments/{experiment:path}/leaderboard": "leaderboard",
    "/methods": "methods",
    "/methods/{method:path}/history": "history",
    "/machines": "machines",
    "/compare": "compare",
}

PROBLEM_SCHEMA = {
    "type": "object",
    "required": ["type", "title", "status", "detail"],
    "properties": {
        "type": {"type": "string"},
        "title": {"type": "string"},
        "status": {"type": "integer"},
        "detail": {"type": "string"},
        "place": {"type": "string", "description": "where the fault is in what was sent"},
        "missing": {"type": "array", "items": {"type": "string"}, "description": "pictures to be sent first"},
    },
}


def problem(description: str) -> dict[str, Any]:
    """Describe an answer that is a problem, for the API's documentation."""
    return {"description": description, "content": {"application/problem+json": {"schema": PROBLEM_SCHEMA}}}


_PROBLEMS: dict[int | str, dict[str, Any]] = {
    401: problem("A token is needed, or this one is not valid."),
    403: problem("The token's scope is not enough."),
    404: problem("There is nothing of this name."),
    422: problem("A parameter is wrong; `place` says which."),
    429: problem("Too many requests, or too many wrong tokens."),
    503: problem("The results cannot be reached just now."),
}

_PICTURE: dict[str, Any] = {"content": {"image/png": {}}, "description": "The picture, encoded by this service."}
_AS_CSV: dict[str, Any] = {"description": "As CSV.", "content": {"text/csv": {"schema": {"type": "string"}}}}

_READ_RESPONSES: dict[str, dict[int | str, dict[str, Any]]] = {
    "json": _PROBLEMS,
    "csv": {200: _AS_CSV, **_PROBLEMS},
}


def _as_json(name: str) -> dict[str, Any]:
    return {"description": "As JSON.", "content": schemas.content(schemas.ANSWERS[name])}


def _named(function: functools.partial[Any], name: str) -> Callable[..., Any]:
    """Give a partial function what FastAPI reads: its signature without ``form``, and a name."""
    import inspect

    signature = inspect.signature(function)
    parameters = [parameter for key, parameter in signature.parameters.items() if key != "form"]

    def call(**given: Any) -> Any:
        return function(**given)

    call.__name__ = name
    call.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return call


def _meaning(method: Callable[..., Any]) -> str:
    return (method.__doc__ or "").strip().rstrip(".")


class _Routes:
    """The functions behind the routes; FastAPI calls them in threads."""

    def __init__(self, store: Store, catalogue: Catalogue, settings: Settings, kept: Answers) -> None:
        self.store, self.catalogue, self.settings, self.kept = store, catalogue, settings, kept
        self.reports = Reports(store, catalogue)
        self.pictures = _Pictures(store, settings.most_pixels)

    def first(self) -> Response:
        """Lead to the list of runs."""
        return RedirectResponse("runs")

    def runs(
        self,
        request: Request,
        *,
        form: str,
        experiment: Text = "",
        method: Text = "",
        machine: Text = "",
        code_version: Text = "",
        status: Text = "",
        q: Text = "",
        after: Text = "",
        limit: Annotated[int, Query(ge=1, le=answers.MOST_RUNS_A_PAGE)] = answers.RUNS_A_PAGE,
    ) -> Response:
        """Runs, newest first; `after` is the last run of the page before."""
        wanted = RunFilter(experiment, method, machine, code_version, status, q)
        return self._say(request, form, lambda: answers.runs(self.catalogue, wanted, limit=limit, after=after))

    def run(self, request: Request, run_id: str, *, form: str) -> Response:
        """A run with its rows, its tables and its claims; in CSV one line a case."""
        return self._say(request, form, lambda: answers.run(self.store, run_id), run_id)

    def claims(self, request: Request, run_id: str, *, form: str) -> Response:
        """What the papers claim, and whether it holds in this run."""
        return self._say(request, form, lambda: answers.claims(self.store, run_id), run_id)

    def case(self, request: Request, run_id: str, case_key: str, *, form: str, experiment: Text = "") -> Response:
        """One case of a run, samples and pictures included."""
        return self._say(request, form, lambda: answers.case(self.store, run_id, case_key, experiment), run_id)

    def experiments(self, request: Request, *, form: str) -> Response:
        """The names of all experiments."""
        return self._say(request, form, lambda: answers.experiments(self.catalogue))

    def leaderboard(
        self,
        request: Request,
        experiment: str,
        *,
        form: str,
        view: Text = "",
        machine: Text = "",
        version: Annotated[list[str] | None, Query(max_length=20)] = None,
        sort: Text = "failure_percent",
        limit: Annotated[int | None, Query(ge=1, le=standings.MOST_LINES)] = None,
    ) -> Response:
        """An experiment's techniques in one view: quality by version, times of one machine."""
        versions = [one for one in version or () if one]
        most = limit or (standings.LINES_A_PAGE if form == "html" else None)

        def make() -> Answer:
            return standings.leaderboard(
                self.catalogue, experiment, view=view, machine=machine, versions=versions, sort=sort, limit=most
            )

        return self._say(request, form, make)

    def methods(self, request: Request, *, form: str) -> Response:
        """The names of all methods."""
        return self._say(request, form, lambda: answers.methods(self.catalogue))

    def history(
        self,
        request: Request,
        method: str,
        *,
        form: str,
        experiment: Text = "",
        view: Text = "",
        machine: Text = "",
        technique: Text = "",
        measure: Text = "dynamic_frame_ms",
    ) -> Response:
        """A method's measurements in the order of time, and where their level changed."""

        def make() -> Answer:
            chosen = {"experiment": experiment, "view": view, "machine": machine, "technique": technique}
            return histories.history(self.catalogue, method, **chosen, measure=measure)

        return self._say(request, form, make)

    def machines(self, request: Request, *, form: str) -> Response:
        """All machines, and what they are."""
        return self._say(request, form, lambda: answers.machines(self.catalogue))

    def compare(self, request: Request, a: Text, b: Text, *, form: str) -> Response:
        """What changed from run `a` to run `b`."""
        return self._say(request, form, lambda: answers.compare(self.store, a, b), a, b)

    def choose(self, request: Request, *, form: str, a: Text = "", b: Text = "") -> Response:
        """What changed from run `a` to run `b`, or a form that asks which they are."""
        if a and b:
            return self.compare(request, a, b, form=form)
        return self._say(request, form, lambda: answers.choose(self.catalogue, a, b))

    async def report(self, request: Request, run_id: str) -> Response:
        """Return the one-file report of a run."""
        found = await self.reports.of(run_id)
        headers = {"ETag": f'"{found.key}"', "Cache-Control": "no-cache", "Vary": "Accept-Encoding, Authorization"}
        if request.headers.get("if-none-match") == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        # its own policy is as good in a header
        headers["Content-Security-Policy"] = f"{found.policy()}; frame-ancestors 'none'"
        if "gzip" in request.headers.get("accept-encoding", ""):
            headers["Content-Encoding"], content = "gzip", found.packed
        else:
            content = await run_in_threadpool(found.unpacked)
        return Response(content, headers=headers, media_type="text/html; charset=utf-8")

    def picture(self, request: Request, name: str) -> Response:
        """Return a picture, encoded by this service: no byte of what was uploaded."""
        try:
            self.store.artifacts.path(name)
        except StoreError:
            raise Problem(404, "this is not the name of a picture") from None
        headers = {"ETag": f'"{name}"', "Cache-Control": "private, max-age=31536000, immutable"}
        if request.headers.get("if-none-match") == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        return Response(self.pictures.get(name), headers=headers, media_type="image/png")

    def _say(self, request: Request, form: str, make: Callable[[], Answer], *run_ids: str) -> Response:
        """Answer a request; ``run_ids`` names the runs that the answer is made of, if it is of these alone."""

        def state() -> str:
            return " ".join(self.catalogue.state_of(run_id) for run_id in run_ids)

        return self.kept.respond(request, form, make, state if run_ids else None)


class _Pictures:
    """Pictures encoded anew, the last ones kept."""

    def __init__(self, store: Store, most_pixels: int) -> None:
        self._store, self._most_pixels = store, most_pixels
        self._kept: OrderedDict[str, bytes] = OrderedDict()
        self._size = 0
        self._lock = threading.Lock()

    def get(self, name: str) -> bytes:
        with self._lock:
            if name in self._kept:
                self._kept.move_to_end(name)
                return self._kept[name]
        if not self._store.artifacts.path(name).is_file():
            raise Problem(404, "there is no such picture")
        try:
            content = encoded_again(self._store.artifact(name), self._most_pixels)
        except PictureError as error:
            raise Problem(404, f"the file {error}") from None
        with self._lock:
            if name not in self._kept:
                self._kept[name] = content
                self._size += len(content)
            while self._size > _PICTURE_BYTES:
                self._size -= len(self._kept.popitem(last=False)[1])
        return content
