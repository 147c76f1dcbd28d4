"""Who may ask: the page of this machine's browser alone, by host, origin, token and cookie.

A page of a stranger runs in the same browser and may send requests here. It is told apart by what
it cannot forge: the names Host and Origin (DNS rebinding makes both its own, so they are compared
with a list and not with each other alone), Sec-Fetch-Site, and a cookie that only the token in the
address of `flightid app` gives. Other local ports get that cookie too, so it does not suffice.
"""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import field
from typing import Any
from urllib.parse import parse_qs

from flightid.frozen import dataclass

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]

POLICY = (
    "default-src 'none'; script-src 'self'; style-src-elem 'self' 'unsafe-inline'; "
    "style-src-attr 'unsafe-inline'; img-src 'self' data: blob:; connect-src 'self'; "
    "worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
SANDBOXED = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""For documents that an answer hands over whole: no script, no request, no origin of ours."""
REPORT_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
"""Of a study's report: scripts run in an origin of their own; its own policy adds hashes."""
HEADERS = {
    "content-security-policy": POLICY,
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "x-content-type-options": "nosniff",
    "cache-control": "no-store",
}
"""On every answer, refusals too."""
METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE"})
BODIES = {
    "POST": "application/json",
    "PATCH": "application/json",
    "PUT": "application/octet-stream",
}
"""Type that a body must have: none of them can be sent by a form, or without being asked first."""
DOCUMENT_BYTES = 1 << 20
UPLOAD_BYTES = 1 << 30
"""Most bytes of a body in JSON, and of a log."""
MOST_DIGITS = 18
FIRST = "/"
ENTRY = (
    "<!doctype html><html lang=en><meta charset=utf-8><title>flightid</title>"
    '<meta http-equiv="refresh" content="0; url=/"><p>flightid is opening …</p></html>'
)
"""A refresh begins a navigation of our own, which carries the cookie; a redirect of a link that
was clicked on a foreign page does not."""


@dataclass(frozen=True)
class Refusal:
    """Why a request is not answered: a status and a sentence."""

    status: int
    reason: str


@dataclass
class Session:
    """The one browser that may ask, on one port.

    Attributes
    ----------
    port : int
        Where the server listens.
    token : str
        In the address that `flightid app` opens; it is worth one cookie.
    secret : str
        Value of the cookie.
    """

    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    secret: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    used: bool = False

    @property
    def cookie(self) -> str:
        """Name of the cookie: browsers keep one jar for all ports."""
        return f"flightid-{self.port}"

    @property
    def hosts(self) -> tuple[str, ...]:
        """What Host may say."""
        return tuple(f"{name}:{self.port}" for name in ("127.0.0.1", "localhost", "[::1]"))

    @property
    def address(self) -> str:
        """The address that opens the page once."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    def admits(self, token: str) -> bool:
        """Whether a token is ours and was not used; it is used up by that."""
        right = secrets.compare_digest(token.encode(), self.token.encode())
        admitted = right and not self.used
        self.used = self.used or admitted
        return admitted

    def knows(self, value: str) -> bool:
        """Whether a cookie's value is ours."""
        return secrets.compare_digest(value.encode(), self.secret.encode())


class Guard:
    """Stands before the application and lets nothing else through.

    Parameters
    ----------
    application : callable
        What answers, by the ASGI protocol.
    session : Session
    """

    def __init__(self, application: Application, session: Session) -> None:
        self._application = application
        self._session = session

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope["type"] == "lifespan":
            await self._application(scope, receive, send)
            return
        headers = _headers(scope)
        refusal = self.refusal(scope, headers)
        if scope["type"] == "websocket":
            if refusal is not None:
                await receive()
                await send({"type": "websocket.close", "code": 1008, "reason": refusal.reason})
                return
            await self._application(scope, receive, send)
            return
        tokens = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        enters = scope["path"] == FIRST and scope["method"] == "GET" and bool(tokens)
        if enters and (refusal is None or refusal.status == 401):
            # A reload of the link by who is in already is no second use.
            if refusal is None or self._session.admits(tokens[-1]):
                await _answer(send, 200, ENTRY, "text/html; charset=utf-8", self._cookie())
                return
            refusal = Refusal(403, "This link was used, or is not ours; start flightid app again.")
        if refusal is not None:
            await _answer(send, refusal.status, f"{refusal.reason}\n", "text/plain; charset=utf-8")
            return
        await self._application(scope, _bounded(scope, receive), _dressed(send))

    def refusal(self, scope: Scope, headers: dict[str, list[str]]) -> Refusal | None:
        """Why a request is refused; None where it may be answered."""
        hosts = headers.get("host", [])
        if len(hosts) != 1 or hosts[0] not in self._session.hosts:
            return Refusal(421, "This server answers to its own name alone.")
        upgrade = scope["type"] == "websocket"
        origins = headers.get("origin", [])
        if (upgrade and not origins) or any(each != f"http://{hosts[0]}" for each in origins):
            return Refusal(403, "This request comes from another page.")
        sites = headers.get("sec-fetch-site", [])
        first = scope["path"] == FIRST and not upgrade and scope["method"] in ("GET", "HEAD")
        # Browsers leave the header out where a socket is opened; there Origin has told.
        told = bool(sites) or upgrade
        if not first and not (told and all(site == "same-origin" for site in sites)):
            return Refusal(403, "This request does not come from the page of flightid.")
        if not any(map(self._session.knows, _cookies_of(headers, self._session.cookie))):
            return Refusal(401, "Open the address that flightid app has printed.")
        return None if upgrade else _refused_body(scope, headers)

    def _cookie(self) -> str:
        session = self._session
        return f"{session.cookie}={session.secret}; Path=/; HttpOnly; SameSite=Strict"


def _refused_body(scope: Scope, headers: dict[str, list[str]]) -> Refusal | None:
    method = scope["method"]
    if method not in METHODS:
        return Refusal(405, "This method is not answered.")
    given = headers.get("content-type", [""])[0].partition(";")[0].strip().lower()
    needed = BODIES.get(method)
    if needed is not None and given != needed:
        return Refusal(415, f"A body of {needed} is needed.")
    length = headers.get("content-length", ["0"])[0]
    plain = length.isascii() and length.isdigit() and len(length) <= MOST_DIGITS
    if not plain or int(length) > _most(method):
        return Refusal(413, f"The body is longer than {_most(method) >> 20} MiB.")
    return None


def _most(method: str) -> int:
    return UPLOAD_BYTES if method == "PUT" else DOCUMENT_BYTES


def _headers(scope: Scope) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for name, value in scope["headers"]:
        found.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))
    return found


def _cookies_of(headers: dict[str, list[str]], name: str) -> list[str]:
    """Values of a cookie. Other pages of this machine share the jar: theirs are passed over."""
    pairs = [part.partition("=") for line in headers.get("cookie", []) for part in line.split(";")]
    return [value.strip() for key, _, value in pairs if key.strip() == name]


def _bounded(scope: Scope, receive: Receive) -> Receive:
    """Bytes of a body without a length are counted as they come; too many end it."""
    taken = 0

    async def counted() -> MutableMapping[str, Any]:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        return {"type": "http.disconnect"} if taken > _most(scope["method"]) else message

    return counted


def _dressed(send: Send) -> Send:
    """Answers with our headers, over those of the application."""

    async def dressed(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            own = {name.encode(): value.encode() for name, value in HEADERS.items()}
            policy = b"content-security-policy"
            for loose in (SANDBOXED.encode(), REPORT_POLICY.encode()):
                if (policy, loose) in message["headers"]:
                    own[policy] = loose
            kept = [(name, value) for name, value in message["headers"] if name not in own]
            message["headers"] = [*kept, *own.items()]
        await send(message)

    return dressed


async def _answer(send: Send, status: int, text: str, kind: str, cookie: str = "") -> None:
    headers = [*HEADERS.items(), ("content-type", kind)]
    headers += [("set-cookie", cookie)] if cookie else []
    start = {"type": "http.response.start", "status": status}
    await send({**start, "headers": [(n.encode(), v.encode()) for n, v in headers]})
    await send({"type": "http.response.body", "body": text.encode()})
