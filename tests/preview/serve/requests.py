"""Requests to a server that is tested: sound ones, and thousands that are not."""

from __future__ import annotations

import base64
import json
import random
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread
from typing import Any

from fabricusd.preview.serve.server import TOKEN, Server
from fabricusd.preview.serve.session import Session

SOUND: dict[str, dict[str, Any]] = {
    "/fabric": {"cloth": 0, "side": "front", "weave": "10/01", "coverage": [0.5, 0.5]},
    "/open": {"name": "a.wif", "data": "AAAA"},
    "/render": {
        "cloth": 0, "shape": "cylinder", "level": "far", "size": 16, "samples": 1,
        "eye": [0, 0, 1], "right": [1, 0, 0], "up": [0, 1, 0], "focal": 2.0, "even": 0.3,
        "slope": 0.1, "key": 1.0,
    },
    "/save": {"cloth": 0, "variant": "review"},
}  # fmt: skip
"""What each address takes."""

BELOW, BEYOND = -1, 10**9
JUNK: tuple[Any, ...] = (
    None, True, BELOW, BEYOND, 1e300, -0.5, "", "\x00", "../../etc/passwd", "front\n", "é é" * 50,
    [], [[]], [None], {}, {"a": []}, [1e300] * 3, 10**400, "9" * 5000, "\ud800",
)  # fmt: skip
"""Values that no name of a request can have, or not all of them."""


@contextmanager
def serving(session: Session) -> Iterator[Server]:
    """A server in a thread of its own."""
    server = Server(session)
    thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        session.end()
        server.server_close()
        thread.join()


def headers_of(server: Server, body: bytes, **other: str | None) -> list[tuple[str, str]]:
    """The headers of a sound request; other : instead of one, None for none of it."""
    host = f"127.0.0.1:{server.server_port}"
    said: dict[str, str | None] = {
        "Host": host, "Origin": f"http://{host}", TOKEN: server.token,
        "Content-Type": "application/json", "Content-Length": str(len(body)),
    }  # fmt: skip
    said.update({name.replace("_", "-"): value for name, value in other.items()})
    return [(name, value) for name, value in said.items() if value is not None]


def request(
    path: str, headers: list[tuple[str, str]], body: bytes = b"", method: str = "POST"
) -> bytes:
    """The bytes of a request."""
    head = f"{method} {path} HTTP/1.1\r\n" + "".join(f"{n}: {v}\r\n" for n, v in headers)
    return (head + "\r\n").encode("utf-8", "surrogateescape") + body


def answered(server: Server, sent: bytes) -> tuple[int, bytes]:
    """(status, the whole answer); 0 where the connection is closed without one."""
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=60) as one:
        try:
            one.sendall(sent)
            one.shutdown(socket.SHUT_WR)
            got = b""
            while piece := one.recv(65536):
                got += piece
        except OSError:
            # A server that refuses may close before all has arrived.
            got = b""
    words = got.split(b" ", 2)
    return (int(words[1]) if len(words) > 1 and words[1].isdigit() else 0), got


def asked(server: Server, path: str, said: Any, **other: str | None) -> tuple[int, Any, bytes]:
    """(status, what the JSON of the answer says, the whole answer)."""
    body = json.dumps(said).encode()
    status, got = answered(server, request(path, headers_of(server, body, **other), body))
    return status, json.loads(got.partition(b"\r\n\r\n")[2] or b"null"), got


def malformed(server: Server, rng: random.Random, secret: str) -> bytes:
    """A request that must not be answered; secret : a file that must not be read."""
    kinds = (_garbage, _line, _header, _length, _json, _value, _unknown, _file)
    return rng.choice(kinds)(server, rng, secret)


def _any(rng: random.Random) -> tuple[str, dict[str, Any]]:
    path = rng.choice(list(SOUND))
    return path, json.loads(json.dumps(SOUND[path]))


def _sent(server: Server, path: str, said: Any, **other: str | None) -> bytes:
    body = said if isinstance(said, bytes) else json.dumps(said).encode()
    return request(path, headers_of(server, body, **other), body)


def _garbage(server: Server, rng: random.Random, secret: str) -> bytes:
    return rng.randbytes(rng.randrange(200)) + rng.choice((b"", b"\r\n", b"\r\n\r\n"))


def _line(server: Server, rng: random.Random, secret: str) -> bytes:
    path, said = _any(rng)
    sent = _sent(server, path, said)
    line = rng.choice(
        (
            b"GET %s HTTP/1.1", b"POST /../../etc/passwd HTTP/1.1", b"GET /%%2e%%2e/x HTTP/1.1",
            b"OPTIONS %s HTTP/1.1", b"PUT %s HTTP/1.1", b"DELETE / HTTP/1.1", b"POST %s HTTP/9.9",
            b"POST %s", b"POST  HTTP/1.1", b"POST http://evil/%s HTTP/1.1", b"POST %s/ HTTP/1.1",
            b"POST %s?x HTTP/1.1", b"TRACE %s HTTP/1.1", b"POST //%s HTTP/1.1",
        )
    )  # fmt: skip
    line = line % path.encode() if b"%s" in line else line.replace(b"%%", b"%")
    return line + sent[sent.index(b"\r\n") :]


def _header(server: Server, rng: random.Random, secret: str) -> bytes:
    path, said = _any(rng)
    name = rng.choice(("Host", "Origin", TOKEN, "Content-Type"))
    value = rng.choice((None, "", "null", "http://evil.example", server.token[:-1], "é", "x" * 999))
    sent = _sent(server, path, said, **{name: value})
    if rng.random() < 0.2:
        again = request(path, [*headers_of(server, b""), (name, "twice")])
        return again
    return sent


def _length(server: Server, rng: random.Random, secret: str) -> bytes:
    path, said = _any(rng)
    value = rng.choice((None, "-1", "1e3", "99999999999999", "3000000000", "\u0663", "+2", "5000"))
    other: dict[str, str | None] = {"Content-Length": value}
    if rng.random() < 0.2:
        other["Transfer-Encoding"] = "chunked"
    return _sent(server, path, said, **other)


def _json(server: Server, rng: random.Random, secret: str) -> bytes:
    path, said = _any(rng)
    text = json.dumps(said).encode()
    body = rng.choice(
        (
            text[: rng.randrange(1, len(text))], b"", b"[]", b"null", b"3", b"[" * 100_000,
            b'{"a":' * 5000, b'{"cloth": NaN}', b'{"cloth": Infinity}', rng.randbytes(60),
            b"\xff" + text, text + b"x", json.dumps(json.dumps(said)).encode(),
        )
    )  # fmt: skip
    return _sent(server, path, body)


def _value(server: Server, rng: random.Random, secret: str) -> bytes:
    path, said = _any(rng)
    # A name whose every junk value is refused.
    firm = {
        "/fabric": ("cloth", "side", "weave"), "/open": ("name", "data"),
        "/render": ("size", "samples", "eye", "right", "up", "focal", "level", "shape"),
        "/save": ("cloth", "variant"),
    }[path]  # fmt: skip
    name = rng.choice(firm)
    junk = rng.choice(JUNK)
    if name == "weave" and junk == "":
        junk = "2"
    said[name] = junk
    return _sent(server, path, json.dumps(said).encode())


def _unknown(server: Server, rng: random.Random, secret: str) -> bytes:
    path, said = _any(rng)
    said[rng.choice(("file", "path", "__class__", "Cloth", "", "\x00", secret))] = rng.choice(JUNK)
    return _sent(server, path, json.dumps(said).encode())


def _file(server: Server, rng: random.Random, secret: str) -> bytes:
    name = rng.choice(
        (
            "a.wif", "a.usda", "a.png", "a.jpg", "a.usd", "a.usdc", "a.exr", "a", ".usda", secret,
            f"../../{secret}", "a.usda\x00.wif", "a.tif", "a.webp", "x" * 4000 + ".usda",
        )
    )  # fmt: skip
    content = rng.choice(
        (
            b"", b"#usda 1.0\n", b"#usda 1.0\ndef {{", rng.randbytes(50),
            b"\x89PNG" + rng.randbytes(80),
            f"#usda 1.0\n(\nsubLayers = [\n@{secret}@\n]\n)\n".encode(),
            f'#usda 1.0\ndef "A" (\nreferences = @{secret}@\n) {{\n}}\n'.encode(),
            f'#usda 1.0\ndef "A" (\npayload = @{secret}@</Fabric>\n) {{\n}}\n'.encode(),
            f"#EXTM3U\n{secret}\n".encode(), b"[WIF]\nVersion=1.1\n" + rng.randbytes(30),
        )
    )  # fmt: skip
    data = base64.b64encode(content).decode()
    return _sent(server, "/open", {"name": name, "data": data + rng.choice(("", "", "é"))})
