"""`ctrlgen view` as a browser meets it: its own process on the loopback address, asked byte by byte."""

from __future__ import annotations

import io
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import zipfile
from contextlib import closing
from dataclasses import dataclass
from http.client import HTTPConnection
from pathlib import Path

import pytest
from viewed_results import a_diagnosis, a_draft, a_run, written

from ctrlgen.app.commands.cli import app

pytest.importorskip("starlette", reason="starlette is not installed: pip install '.[view]'")
pytest.importorskip("uvicorn", reason="uvicorn is not installed: pip install '.[view]'")

MARKUP = "<img src=x onerror=alert(1)>'\"&amp;"


@dataclass(frozen=True)
class Answer:
    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def text(self) -> str:
        return self.body.decode()


def started(*words: object) -> tuple[subprocess.Popen[str], int]:
    """The command in a process of its own, and the port that it prints."""
    command = [sys.executable, "-m", "ctrlgen", "view", *map(str, words)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"BROWSER": "true"}
    )
    line = process.stdout.readline()
    return process, int(re.search(r"http://127\.0\.0\.1:(\d+)/", line)[1])


@pytest.fixture(scope="module")
def shown(tmp_path_factory) -> Path:
    """Results, a broken one, one with markup in its names and texts, one that is being written, and what no page may show."""
    folder = tmp_path_factory.mktemp("shown") / "out"
    written(folder.parent / "secret.txt", "the secret")
    a_run(folder / "circle", 0.3)
    a_run(folder / "circle2", 0.2)
    a_diagnosis(folder / "a b#?%2f", sentence=MARKUP)
    a_run(folder / MARKUP.replace("/", ""), title=MARKUP)
    written(folder / "broken" / "summary.json", '{"passed": tr')
    (folder / "circle" / "outside").symlink_to(folder.parent / "secret.txt")
    (folder / "circle" / "c" / "outside.c").symlink_to(folder.parent / "secret.txt")
    written(folder / ".env", "the secret")
    a_draft(folder / "axis", {"at": 2e9, "step": f"fit of {MARKUP}"})
    return folder


@pytest.fixture(scope="module")
def get(shown):
    """Asks for an address as it is written, with this Host."""
    process, port = started(shown, "--port", 0)

    def asked(address: str, host: str | None = "127.0.0.1", method: str = "GET") -> Answer:
        with closing(HTTPConnection("127.0.0.1", port, timeout=20)) as connection:
            connection.putrequest(method, address, skip_host=True)
            if host is not None:
                connection.putheader("Host", f"{host}:{port}" if ":" not in host else host)
            connection.endheaders()
            answer = connection.getresponse()
            return Answer(answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read())

    yield asked
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=20) == ("", "") and process.returncode == 0


def test_the_list_shows_every_result_and_what_goes_on(get):
    page = get("/").text
    for name in (
        "/result/0/circle",
        "/result/0/circle2",
        "/result/0/a%20b%23%3F%252f",
        "/result/0/broken",
        "/job/0/axis",
    ):
        assert f'href="{name}"' in page
    assert "unreadable" in page and "within tolerance" in page and 'data-again="2"' in page
    assert "circle2" in get("/?q=CIRCLE2").text and "/result/0/broken" not in get("/?q=CIRCLE2").text


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "0.0.0.0", "[::1]:80", "", None, "a b"]
)
@pytest.mark.parametrize("address", ["/", "/file/0/circle/report.html", "/static/view.css"])
def test_a_foreign_host_gets_nothing(get, host, address):
    answer = get(address, host)
    assert answer.status == 400 and len(answer.body) < 100
    assert get(address, "localhost").status == 200


@pytest.mark.parametrize(
    "steps",
    ["..", "%2e%2e", "%2E.", "..%2f..", "..%5c..", "%252e%252e", "circle/../..", "circle/%2e%2e/%2e%2e", "./..", "/.."],
)
@pytest.mark.parametrize("page", ["file", "result", "zip", "job"])
def test_no_address_leads_out_of_the_folders(get, shown, steps, page):
    for address in (
        f"/{page}/0/{steps}/secret.txt",
        f"/{page}/0/{steps}/{shown.parent.name}/secret.txt",
        f"/{page}/{steps}/secret.txt",
    ):
        answer = get(address)
        assert answer.status == 404 or (page, steps) == (
            "job",
            "%252e%252e",
        )  # a name, of which nothing is being written
        assert "the secret" not in answer.text


@pytest.mark.parametrize(
    "address",
    [
        "/file/0/circle/outside",
        "/file/0/.env",
        "/file/0/.axis.abcd1234/.steps",
        "/file/0//etc/passwd",
        "/file//etc/passwd",
        "/file/0/circle",
        "/file/7/a",
        "/file/0/a%00b",
        f"/file/0/{'a' * 5000}",
        "/result/0/nothing",
        "/result/0",
        "/zip/0/broken",
        "/static/web_pages.py",
        "/nothing",
    ],
)
def test_what_is_not_shown_is_not_there(get, address):
    answer = get(address)
    assert answer.status == 404 and "the secret" not in answer.text and "Traceback" not in answer.text


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS"])
def test_nothing_is_written(get, method):
    assert get("/file/0/circle/report.html", method=method).status == 405


def test_every_answer_says_what_its_page_may_do(get):
    for address in ("/", "/result/0/circle", "/nothing", "/static/view.js", "/compare?of=0/circle&of=0/circle2"):
        headers = get(address).headers
        assert (
            headers["content-security-policy"].startswith("default-src 'none'")
            and "unsafe" not in headers["content-security-policy"]
        )
        assert (
            headers["x-content-type-options"] == "nosniff"
            and headers["cache-control"] == "no-store"
            and "server" not in headers
        )
    page = get("/file/0/circle/report.html")
    assert (
        page.headers["content-security-policy"].startswith("sandbox allow-scripts")
        and page.headers["x-content-type-options"] == "nosniff"
    )
    assert (
        "allow-same-origin" not in page.headers["content-security-policy"]
        and "connect-src" not in page.headers["content-security-policy"]
    )
    assert page.headers["content-type"].startswith("text/html") and page.body.startswith(b"<!doctype")
    assert get("/file/0/circle/c/circle.c").headers["content-type"].startswith("text/plain")


def test_names_and_texts_with_markup_are_shown_as_they_are(get, shown):
    name = next(path.name for path in shown.iterdir() if path.name.startswith("<img"))
    quoted = "".join(f"%{byte:02x}" for byte in name.encode())
    for address in (
        "/",
        f"/result/0/{quoted}",
        f"/compare?of=0/circle&of=0/{quoted}",
        f"/?q={quoted}",
        "/job/0/axis",
        f"/nothing/{quoted}",
    ):
        text = get(address).text
        assert "<img" not in text and "onerror=alert(1)>'" not in text, address
    assert "&lt;img src=x onerror=alert(1)&gt;" in get(f"/result/0/{quoted}").text
    assert get(f"/file/0/{quoted}/report.html").status == 200
    assert get("/result/0/a%20b%23%3F%252f").status == 200


def test_a_result_that_is_broken_says_so(get):
    answer = get("/result/0/broken")
    assert answer.status == 200 and "Unreadable" in answer.text and "summary.json cannot be read" in answer.text
    assert get("/compare?of=0/broken&of=0/circle").status == 200


def test_two_results_are_compared_with_what_differs_first(get):
    text = get("/compare?of=0/circle&of=0/circle2").text
    differ, same = text.split("The same in both")
    assert "margins" in differ and "share_left" in differ and "-33.3 %" in differ and "tracking error" not in differ
    assert "delta_x [um]" in same
    for few in ("/compare", "/compare?of=0/circle", "/compare?of=0/circle&of=0/circle2&of=0/broken"):
        assert get(few).status == 400 and "Choose two results" in get(few).text
    assert get("/compare?of=0/circle&of=0/../secret.txt").status == 404
    assert "only what both state" in get("/compare?of=0/circle&of=0/a%20b%23%3F%252f").text


def test_the_c_comes_as_one_zip(get):
    answer = get("/zip/0/circle")
    assert (
        answer.headers["content-type"] == "application/zip" and "circle_c.zip" in answer.headers["content-disposition"]
    )
    with zipfile.ZipFile(io.BytesIO(answer.body)) as archive:
        assert archive.namelist() == ["c/circle.c", "c/manifest.json", "c/test/test.c"]
        assert archive.read("c/circle.c") == b"int circle;\n"
    assert "/zip/0/circle" in get("/result/0/circle").text and "/zip/" not in get("/result/0/a%20b%23%3F%252f").text


def test_a_result_that_is_being_written_is_followed_until_it_is_there(get, shown):
    text = get("/job/0/axis").text
    assert "Is being written" in text and "fit of &lt;img" in text
    shutil.rmtree(shown / ".axis.abcd1234")
    assert "Nothing is being written here" in get("/job/0/axis").text
    a_diagnosis(shown / "axis")
    text = get("/job/0/axis").text
    assert "Done" in text and "/result/0/axis" in text and "data-again" not in text
    shutil.rmtree(shown / "axis")
    a_draft(shown / "axis", {"at": 2e9, "step": f"fit of {MARKUP}"})


def test_the_example_of_its_help_works_as_printed(tmp_path, monkeypatch):
    told = next(command.help for command in app.registered_commands if command.callback.__name__ == "view")
    words = shlex.split(re.search(r"Example:  ctrlgen view (.*)", told)[1])
    a_run(tmp_path / "out" / "circle")
    monkeypatch.chdir(tmp_path)
    process, port = started(*words)
    with socket.create_connection(("127.0.0.1", port), timeout=20):
        process.send_signal(signal.SIGINT)  # with a connection that is open
    assert process.communicate(timeout=20) == ("", "") and process.returncode == 0
