"""The server: who is answered, with what headers, and that thousands of bad requests do nothing."""

from __future__ import annotations

import os
import random
import sys
import tempfile
from pathlib import Path

import pytest

from fabricusd.fabric import Fabric
from fabricusd.preview.lights import Lights
from fabricusd.preview.serve import server as served
from fabricusd.preview.serve.session import Session
from fabricusd.schema.write import save
from tests.preview.serve.requests import (
    SOUND,
    answered,
    asked,
    headers_of,
    malformed,
    request,
    serving,
)

OPENED: list[str] | None = None
"""Files that Python opens, while a test watches."""


def _watch(event: str, arguments: tuple[object, ...]) -> None:
    if OPENED is not None and event == "open":
        OPENED.append(str(arguments[0]))


sys.addaudithook(_watch)


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    folder = tmp_path_factory.mktemp("served")
    with serving(Session(Fabric(), lights=Lights(), save=folder / "look.usda")) as one:
        yield one


def test_the_page_s_own_code_needs_no_token_and_says_nothing_of_the_cloth(server):
    host = f"127.0.0.1:{server.server_port}"
    for path, start in (("/", b"<!doctype html>"), ("/page.js", b"//"), ("/page.css", b":root")):
        status, got = answered(server, request(path, [("Host", host)], method="GET"))
        head, _, body = got.partition(b"\r\n\r\n")
        assert status == 200
        assert body.startswith(start)
        assert server.token.encode() not in got
        assert b"Content-Security-Policy: default-src 'none'; script-src 'self'" in head
        assert b"unsafe" not in head
        assert b"Access-Control" not in head
    assert b"<script>" not in answered(server, request("/", [("Host", host)], method="GET"))[1]


def test_a_sound_request_is_answered(server):
    status, said, _ = asked(server, "/save", SOUND["/save"])
    assert (status, said["variant"]) == (200, "review")
    server.session.file.unlink()
    server.session.saved = None


@pytest.mark.parametrize(
    ("other", "status"),
    [
        ({"Origin": "http://evil.example"}, 403), ({"Origin": "null"}, 403),
        ({"Origin": None}, 403),
        ({"Origin": "http://127.0.0.1:1"}, 403), ({served.TOKEN: None}, 403),
        ({served.TOKEN: "x"}, 403), ({"Host": "evil.example"}, 421), ({"Host": None}, 421),
        ({"Sec-Fetch-Site": "cross-site"}, 403), ({"Sec-Fetch-Site": "same-site"}, 403),
        ({"Content-Type": "text/plain"}, 415), ({"Content-Length": "99999999999"}, 413),
        ({"Content-Length": "x"}, 411), ({"Transfer-Encoding": "chunked"}, 501),
        ({"Expect": "100-continue"}, 417),
    ],
)  # fmt: skip
def test_who_has_no_business_here_is_refused(server, other, status):
    for path in server.session.answers:
        found, said, got = asked(server, path, SOUND[path], **other)
        assert found == status
        assert list(said) == ["error"]
        assert b"Access-Control" not in got
    assert not server.session.file.exists()


def test_a_preflight_of_another_origin_is_not_allowed(server):
    headers = [
        *headers_of(server, b"", Origin="http://evil.example"),
        ("Access-Control-Request-Method", "POST"),
        ("Access-Control-Request-Headers", served.TOKEN),
    ]
    status, got = answered(server, request("/fabric", headers, method="OPTIONS"))
    assert status == 501
    assert b"Access-Control-Allow" not in got


def test_a_session_that_ended_answers_no_more():
    session = Session(Fabric(), lights=Lights())
    with serving(session) as server:
        session.stop.asked = True
        assert asked(server, "/save", SOUND["/save"])[0] == 503


def test_what_goes_wrong_inside_is_one_line_and_no_traceback(server, monkeypatch, capfd):
    def wrong(*_):
        raise IndexError("nobody expected this")

    monkeypatch.setattr(server.session, "answer", wrong)
    status, said, _ = asked(server, "/save", SOUND["/save"])
    assert status == 500
    assert "nobody expected this" in said["error"]
    printed = capfd.readouterr().err
    assert "internal error" in printed
    assert "Traceback" not in printed


def _bombarded(server, tmp_path, capfd, count: int, seed: int) -> None:
    """Send malformed requests; none is answered, prints, writes, or reads what it should not."""
    global OPENED
    secret = tmp_path / "secret.usda"
    save(Fabric(name="Secret", documentation="must-not-be-read"), secret)
    rng = random.Random(seed)
    before = sorted(path.name for path in server.session.file.parent.iterdir())
    statuses: dict[int, int] = {}
    OPENED = []
    try:
        for _ in range(count):
            sent = malformed(server, rng, str(secret))
            status, got = answered(server, sent)
            statuses[status] = statuses.get(status, 0) + 1
            assert status == 0 or 400 <= status < 600, sent[:600]
            assert status != 500, got
            assert b"must-not-be-read" not in got
            assert b"Traceback" not in got
        opened = OPENED
    finally:
        OPENED = None
    assert sorted(path.name for path in server.session.file.parent.iterdir()) == before
    private = str(Path(tempfile.gettempdir()) / "fabricusd-")
    # What Python itself opens when it imports a library for the first time.
    own = (*(folder for folder in sys.path[1:] if folder), sys.prefix, sys.base_prefix, os.devnull)
    others = [path for path in opened if not path.startswith((private, *own))]
    assert others == []
    printed = capfd.readouterr()
    assert printed.err == ""
    assert printed.out == ""
    # Each way to be wrong was tried, and the server still answers.
    assert set(statuses) >= {0, 400, 403, 404, 411, 413, 421, 422, 501}
    assert asked(server, "/fabric", {"cloth": 7})[0] == 422


def test_hundreds_of_malformed_requests_do_nothing(server, tmp_path, capfd):
    _bombarded(server, tmp_path, capfd, 600, 1)


@pytest.mark.exhaustive
def test_ten_thousand_malformed_requests_do_nothing(server, tmp_path, capfd):
    _bombarded(server, tmp_path, capfd, 10_000, 2)


def test_too_many_connections_are_closed_and_others_served_later(server):
    for _ in range(served.MOST_AT_ONCE):
        assert server._free.acquire(timeout=60)
    assert asked_or_closed(server) == 0
    for _ in range(served.MOST_AT_ONCE):
        server._free.release()
    assert asked_or_closed(server) == 422


def asked_or_closed(server) -> int:
    """The status of a request for a cloth that is not open; 0 where it was closed."""
    body = b'{"cloth": 9}'
    return answered(server, request("/fabric", headers_of(server, body), body))[0]
