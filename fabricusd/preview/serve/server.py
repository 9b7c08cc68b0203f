"""The server of the page: on the loopback interface, for whoever has the token, from no other page.

What is served without the token is the page's own code. Everything about the cloth, and everything
that takes time or writes, is a POST that must have the token in a header, be addressed to this
server by its Host, and come from its own page by its Origin. Browsers let no page of another origin
send such a header, since no answer allows it.
"""

from __future__ import annotations

import hmac
import json
import secrets
import socket
import socketserver
import sys
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from fabricusd.errors import FabricError, debugging, described, one_line
from fabricusd.preview.page.make import POLICY, script, shell, style
from fabricusd.preview.serve.session import Session

LOOPBACK = "127.0.0.1"

TOKEN = "X-Fabricusd-Token"
"""Header of the token."""

MOST_BODY = 24 << 20
"""Bytes of the largest request: a file of 16 MB in base64."""

MOST_AT_ONCE = 16
"""Connections that are served at once; a browser opens six."""

PATIENCE = 20.0
"""Seconds in which a request must have arrived."""

HEADERS = {
    "Content-Security-Policy": POLICY.format(script="'self'", style="'self'", connect="'self'")
    + "; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff", "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer", "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin", "Cross-Origin-Opener-Policy": "same-origin",
}  # fmt: skip
"""Headers of every answer. None lets another origin read it."""

ONCE = ("Host", "Origin", "Content-Length", "Content-Type", TOKEN)
"""Headers that a request may have once."""


class Refusal(Exception):
    """A request that is not answered: (status, line)."""

    def __init__(self, status: HTTPStatus, line: str) -> None:
        super().__init__(line)
        self.status, self.line = status, line


class Server(ThreadingHTTPServer):
    """The server of one session; `url` opens its page, the token included."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = 2 * MOST_AT_ONCE

    def __init__(self, session: Session, port: int = 0, token: str = "") -> None:
        self.session, self.token = session, token or secrets.token_urlsafe(32)
        self.files = {
            "/": ("text/html; charset=utf-8", shell().encode()),
            "/page.js": ("text/javascript; charset=utf-8", script().encode()),
            "/page.css": ("text/css; charset=utf-8", style().encode()),
        }
        self._free = threading.BoundedSemaphore(MOST_AT_ONCE)
        super().__init__((LOOPBACK, port), Handler)
        self.hosts = {f"{name}:{self.server_port}" for name in (LOOPBACK, "localhost")}

    @property
    def url(self) -> str:
        """The address of the page. What follows the # is never sent: the page reads it there."""
        return f"http://{LOOPBACK}:{self.server_port}/#token={self.token}"

    def server_bind(self) -> None:
        """Bind without the look-up of a name that HTTPServer does."""
        # On Windows, another program could bind the same address.
        if hasattr(socket, "SO_EXCLUSIVEADDRUSE"):
            self.allow_reuse_address = False
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
        socketserver.TCPServer.server_bind(self)
        self.server_name, self.server_port = LOOPBACK, self.server_address[1]

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread, or close it where too many are open."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """As the base class, and make room for another connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """One line for what no request should cause; a client that went away is none."""
        error = sys.exc_info()[1]
        if error is not None and not isinstance(error, OSError):
            _report(error)


class Handler(BaseHTTPRequestHandler):
    """One connection."""

    server: Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "fabricusd", ""
    timeout = PATIENCE
    error_content_type = "application/json"
    error_message_format = '{"error": "%(code)d"}'

    def do_GET(self) -> None:
        """The page's own code."""
        self._answer(self._file)

    def do_POST(self) -> None:
        """One of the session's answers."""
        self._answer(self._reply)

    def handle_expect_100(self) -> bool:
        """Refuse to be asked before a body is sent: the checks come with the request."""
        self._send(HTTPStatus.EXPECTATION_FAILED, {"error": "send the body with the request"})
        self.close_connection = True
        return False

    def _answer(self, found: Any) -> None:
        try:
            self._require_own_host()
            found()
        except Refusal as refusal:
            # What is left of the request is not read, so no other can follow it.
            self.close_connection = True
            self._send(refusal.status, {"error": refusal.line})
        except FabricError as error:
            self._send(HTTPStatus.UNPROCESSABLE_ENTITY, {"error": one_line(str(error))})
        except KeyboardInterrupt:
            self.close_connection = True
            self._send(HTTPStatus.SERVICE_UNAVAILABLE, {"error": "the server was stopped"})
        except OSError:
            # The client went away.
            self.close_connection = True
        except Exception as error:
            self.close_connection = True
            _report(error)
            line = f"internal error: {described(error)}"
            self._send(HTTPStatus.INTERNAL_SERVER_ERROR, {"error": line})

    def _require_own_host(self) -> None:
        """Refuse a request for another host, such as of a page whose name leads here."""
        for name in ONCE:
            if len(self.headers.get_all(name, [])) > 1:
                raise Refusal(HTTPStatus.BAD_REQUEST, f"{name} is given more than once")
        if self.headers.get("Host", "") not in self.server.hosts:
            raise Refusal(HTTPStatus.MISDIRECTED_REQUEST, "this is not the host that was asked for")
        if self.headers.get("Sec-Fetch-Site", "same-origin") not in ("same-origin", "none"):
            raise Refusal(HTTPStatus.FORBIDDEN, "another page has no business here")
        # The base class makes one slash of several.
        if self.requestline.split()[1] != self.path:
            raise Refusal(HTTPStatus.NOT_FOUND, "there is nothing here")
        if self.headers.get("Transfer-Encoding") is not None:
            raise Refusal(HTTPStatus.NOT_IMPLEMENTED, "send Content-Length")

    def _file(self) -> None:
        if self.headers.get("Content-Length", "0") != "0":
            raise Refusal(HTTPStatus.BAD_REQUEST, "a GET has no body")
        if self.path not in self.server.files:
            raise Refusal(HTTPStatus.NOT_FOUND, "there is nothing here")
        self._write(HTTPStatus.OK, *self.server.files[self.path])

    def _reply(self) -> None:
        if self.headers.get("Origin", "") not in {f"http://{host}" for host in self.server.hosts}:
            raise Refusal(HTTPStatus.FORBIDDEN, "this is not for pages of another origin")
        token = self.headers.get(TOKEN, "").encode("utf-8", "surrogateescape")
        if not hmac.compare_digest(token, self.server.token.encode()):
            raise Refusal(HTTPStatus.FORBIDDEN, "the token is missing, or another")
        if self.path not in self.server.session.answers:
            raise Refusal(HTTPStatus.NOT_FOUND, "there is nothing here")
        if self.headers.get("Content-Type", "") != "application/json":
            raise Refusal(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "send application/json")
        body = self._body()
        self._send(HTTPStatus.OK, self.server.session.answer(self.path, body))

    def _body(self) -> bytes:
        said = self.headers.get("Content-Length", "")
        if not (said.isascii() and said.isdigit() and len(said) < 12):
            raise Refusal(HTTPStatus.LENGTH_REQUIRED, "Content-Length is missing, or no number")
        if int(said) > MOST_BODY:
            raise Refusal(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"the request has more than {MOST_BODY} bytes"
            )
        body = self.rfile.read(int(said))
        if len(body) != int(said):
            raise Refusal(HTTPStatus.BAD_REQUEST, "the request ends too early")
        return body

    def _send(self, status: HTTPStatus, said: Any) -> None:
        text = json.dumps(said, separators=(",", ":"), allow_nan=False)
        self._write(status, "application/json", text.encode())

    def _write(self, status: HTTPStatus, kind: str, content: bytes) -> None:
        try:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            if self.close_connection:
                self.send_header("Connection", "close")
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(content)
        except OSError:
            self.close_connection = True

    def end_headers(self) -> None:
        """Every answer has HEADERS, those of the base class included."""
        for name, value in HEADERS.items():
            self.send_header(name, value)
        super().end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not logged: the terminal belongs to the user."""


def _report(error: BaseException) -> None:
    if debugging():
        import traceback

        traceback.print_exception(error)
        return
    print(f"fabricusd: internal error: {described(error)}; please report it", file=sys.stderr)
