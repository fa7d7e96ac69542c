"""The pages of `ctrlgen view`, as an application of Starlette.

What keeps others out: `LOOPBACK` names the only hosts that are answered, so that a foreign page whose name was made to lead to this
computer (DNS rebinding) gets nothing; every answer says by `POLICY` or `FOREIGN` what its page may do. Files of a result are shown in a
sandbox: their scripts run, with no origin, so that they can read neither these pages nor other files, and send nothing.
"""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.routing import Route

from ctrlgen.app.viewer.c_archive import c_archive, c_folder
from ctrlgen.app.viewer.compared_results import ComparedRow, compared
from ctrlgen.app.viewer.followed_jobs import followed_jobs
from ctrlgen.app.viewer.found_results import found_results, result_at
from ctrlgen.app.viewer.viewed_folders import Absent, Place, ViewedFolders
from ctrlgen.core.counts import number_of
from ctrlgen.core.percent import percent
from ctrlgen.reporting.html import render
from ctrlgen.reporting.numbers import number
from ctrlgen.version import program

HERE = Path(__file__).parent
LOOPBACK = ["127.0.0.1", "localhost"]
POLICY = (
    "default-src 'none'; style-src 'self'; script-src 'self'; connect-src 'self'; img-src data:; form-action 'self'; "
    "base-uri 'none'; frame-ancestors 'none'"
)
FOREIGN = (
    "sandbox allow-scripts allow-popups allow-downloads; default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
    "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cache-control": "no-store",
}
TYPES = {  # of files that are shown; others are downloaded
    ".html": "text/html; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".pdf": "application/pdf",
    ".json": "application/json",
} | dict.fromkeys(
    (".c", ".cmake", ".csv", ".h", ".ino", ".md", ".properties", ".toml", ".txt", ".yml"), "text/plain; charset=utf-8"
)
STATIC = {"view.css": "text/css; charset=utf-8", "view.js": "text/javascript; charset=utf-8"}
MOST_SHOWN = 500  # results in a list, files of a result

Answer = Callable[[Request], Response]
Scope = MutableMapping[str, Any]


def pages(folders: ViewedFolders) -> Callable[..., Awaitable[None]]:
    """The application that shows these folders. It answers GET and HEAD alone."""
    shown = _Pages(folders)
    routes = [
        Route("/", shown.list_),
        Route("/result/{at:path}", shown.result),
        Route("/job/{at:path}", shown.job),
        Route("/file/{at:path}", shown.file),
        Route("/zip/{at:path}", shown.archive),
        Route("/compare", shown.compare),
        Route("/static/{name}", shown.static),
    ]
    hosts = Middleware(TrustedHostMiddleware, allowed_hosts=LOOPBACK, www_redirect=False)
    inner = Starlette(
        routes=routes, middleware=[hosts], exception_handlers={HTTPException: shown.refused, Absent: shown.absent}
    )

    async def application(scope: Scope, receive: Any, send: Any) -> None:
        async def with_headers(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                there = {name for name, _ in message["headers"]}
                more = {"content-security-policy": POLICY} | HEADERS
                message["headers"] = [
                    *message["headers"],
                    *((k.encode(), v.encode()) for k, v in more.items() if k.encode() not in there),
                ]
            await send(message)

        await inner(scope, receive, with_headers)

    return application


class _Pages:
    """One method a page; Starlette runs them in threads."""

    def __init__(self, folders: ViewedFolders) -> None:
        self.folders = folders

    def list_(self, request: Request) -> Response:
        q = request.query_params.get("q", "")[:200]
        found = [r for r in found_results(self.folders) if r.matches(q.split())]
        jobs = followed_jobs(self.folders)
        shown = found[:MOST_SHOWN]
        return self._page("list", results=shown, left=len(found) - len(shown), jobs=jobs, q=q, again=bool(jobs))

    def result(self, request: Request) -> Response:
        place = self._place(request)
        found, record = result_at(self.folders, place)
        files = self._files(place)
        others = [r for r in found_results(self.folders) if r.kind is found.kind and r.place != place]
        return self._page(
            "result",
            found=found,
            page=place.below(found.kind.page) if self._is_there(place.below(found.kind.page)) else None,
            c=c_folder(self.folders, place),
            others=others[:MOST_SHOWN],
            files=files[:MOST_SHOWN],
            left=max(0, len(files) - MOST_SHOWN),
            inputs=sorted(_inputs(record).items())[:MOST_SHOWN],
        )

    def job(self, request: Request) -> Response:
        place = self._place(request)
        job = next((job for job in followed_jobs(self.folders) if job.place == place), None)
        name = "/".join(place.parts) or self.folders.name(place.root)
        try:
            done = job is None and result_at(self.folders, place)[0] is not None
        except Absent:
            done = False
        return self._page("job", job=job, place=place, name=name, result=done, again=job is not None)

    def compare(self, request: Request) -> Response:
        chosen = request.query_params.getlist("of")
        if len(chosen) != 2:
            told = "Choose two results in the list: go back, mark two of them, and compare again."
            raise HTTPException(400, told)
        (a, left), (b, right) = (result_at(self.folders, self.folders.place(at)) for at in chosen)
        parts, more = compared(left, right)
        files_a, files_b = _inputs(left), _inputs(right)
        programs = {_program(left), _program(right)}
        return self._page(
            "compare",
            a=a,
            b=b,
            parts=parts,
            left=more,
            rows=sum(len(p.differ) + len(p.agree) for p in parts),
            differ=sum(len(p.differ) for p in parts),
            inputs=[n for n in files_a | files_b if files_a.get(n) != files_b.get(n)],
            programs=sorted(programs) if len(programs) > 1 else [],
            swapped=f"/compare?{urlencode([('of', at) for at in reversed(chosen)])}",
            cells=_cells,
        )

    def file(self, request: Request) -> Response:
        place = self._place(request)
        path = self.folders.file(place)
        kind = TYPES.get(path.suffix.lower())
        headers = {"content-security-policy": FOREIGN, "cross-origin-opener-policy": "unsafe-none"}
        disposition = "inline" if kind else "attachment"
        return FileResponse(
            path,
            headers=headers,
            media_type=kind or "application/octet-stream",
            filename=place.parts[-1],
            content_disposition_type=disposition,
        )

    def archive(self, request: Request) -> Response:
        place = self._place(request)
        content = c_archive(self.folders, place)
        name = quote(f"{place.parts[-1] if place.parts else self.folders.name(place.root)}_c.zip")
        return Response(
            content,
            media_type="application/zip",
            headers={"content-disposition": f"attachment; filename*=utf-8''{name}"},
        )

    def static(self, request: Request) -> Response:
        name = request.path_params["name"]
        if name not in STATIC:
            raise HTTPException(404)
        return Response((HERE / name).read_bytes(), headers={"content-type": STATIC[name]})

    async def refused(self, request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        what = {404: "Not here", 405: "This page is read only"}.get(error.status_code, "Not so")
        told = error.detail if error.status_code == 400 else "There is no such page."
        return self._page("refused", status=error.status_code, what=what, told=told)

    async def absent(self, request: Request, error: Exception) -> Response:
        told = "No such result or file is in the folders that are shown: it was removed or replaced, or the address is wrong."
        return self._page("refused", status=404, what="Not here", told=told)

    def _place(self, request: Request) -> Place:
        return self.folders.place(request.path_params["at"])

    def _page(self, template: str, status: int = 200, **values: Any) -> Response:
        text = render(
            HERE / f"{template}.html.j2",
            **{"again": False} | values,
            program=program(),
            shown=[str(root) for root in self.folders.roots],
            link=_link,
            day=lambda at: time.strftime("%Y-%m-%d %H:%M", time.localtime(at)) if at else "",
            hour=lambda at: time.strftime("%H:%M:%S", time.localtime(at)),
            ago=_ago,
            bytes=_bytes,
        )
        return HTMLResponse(text, status)

    def _is_there(self, place: Place) -> bool:
        try:
            self.folders.file(place)
        except Absent:
            return False
        return True

    def _files(self, place: Place) -> list[tuple[Place, str, str]]:
        """The files of a result, those in its folders too: place, name, size."""
        folder, found = self.folders.folder(place), []
        for path in sorted(folder.rglob("*"))[: 4 * MOST_SHOWN]:
            names = path.relative_to(folder).parts
            if not any(name.startswith(".") for name in names) and path.is_file() and not path.is_symlink():
                found.append((place.below(*names), "/".join(names), _bytes(path.stat().st_size)))
        return sorted(found, key=lambda file: (len(file[0].parts), file[1]))


def _link(page: str, place: Place) -> str:
    return f"/{page}/{quote(place.address)}"


def _inputs(record: dict[str, Any]) -> dict[str, Any]:
    """The files that a result was made from, with their SHA-256."""
    inputs = record.get("inputs")
    return inputs if isinstance(inputs, dict) else {}


def _program(record: dict[str, Any]) -> str:
    made = record.get("program")
    return f"{made.get('version')} {made.get('commit') or ''}".strip() if isinstance(made, dict) else "unknown"


def _ago(at: float) -> str:
    seconds = max(0.0, time.time() - at)
    for size, name in ((86400, "days"), (3600, "hours"), (60, "minutes")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {name} ago"
    return f"{seconds:.0f} seconds ago"


def _bytes(size: int) -> str:
    for power, name in ((9, "GB"), (6, "MB"), (3, "kB")):
        if size >= 10**power:
            return f"{size / 10**power:.3g} {name}"
    return number_of(size, "byte")


def _cells(row: ComparedRow) -> list[dict[str, Any]]:
    """The cells of a row: both values, and the change, in a number of digits that shows it."""
    digits = 4
    if row.is_number and row.difference:
        while digits < 12 and number(float(row.a or 0), digits) == number(float(row.b or 0), digits):
            digits += 1
    texts = ["" if v is None else number(v, digits) if isinstance(v, float) else v for v in (row.a, row.b)]
    change = ""
    if row.is_number and row.difference:
        a, b = float(row.a or 0), float(row.b or 0)
        change = percent((b - a) / abs(a), 3, sign=True) if a else f"{b - a:+.3g}"
    elif row.difference:
        change = "only one" if None in (row.a, row.b) else "other"
    return [{"text": text, "short": len(text) < 30} for text in (*texts, change)]
