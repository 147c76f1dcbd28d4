"""Who may ask the local page: each attempt of a stranger is refused before anything answers it."""

from __future__ import annotations

import asyncio
from collections.abc import MutableMapping
from typing import Any

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from flightid.app.guard import (
    DOCUMENT_BYTES,
    HEADERS,
    POLICY,
    SANDBOXED,
    UPLOAD_BYTES,
    Guard,
    Session,
)

PORT = 8123
SESSION = Session(PORT)
COOKIE = f"{SESSION.cookie}={SESSION.secret}"
OURS = {"host": f"127.0.0.1:{PORT}", "sec-fetch-site": "same-origin", "cookie": COOKIE}
JSON = {"content-type": "application/json"}
Messages = list[MutableMapping[str, Any]]


async def _inner(scope: Any, receive: Any, send: Any) -> None:
    """Answers whatever it is asked, after reading all of it."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        return
    while (message := await receive()).get("more_body"):
        pass
    status = 200 if message["type"] == "http.request" else 499
    await send({"type": "http.response.start", "status": status, "headers": []})
    await send({"type": "http.response.body", "body": b"inside"})


def _asked(
    headers: dict[str, str | None],
    *,
    kind: str = "http",
    method: str = "GET",
    path: str = "/api/workspace",
    query: str = "",
    session: Session = SESSION,
    body: tuple[bytes, ...] = (b"",),
) -> tuple[Any, dict[str, str]]:
    """Status (of a socket: whether it was opened) and headers of the answer."""
    given = {**OURS, **headers}
    scope = {
        "type": kind,
        "method": method,
        "path": path,
        "query_string": query.encode(),
        "headers": [(n.encode(), v.encode()) for n, v in given.items() if v is not None],
    }
    parts, said = list(body), Messages()

    async def receive() -> MutableMapping[str, Any]:
        part = parts.pop(0) if parts else b""
        return {"type": f"{kind}.request", "body": part, "more_body": bool(parts)}

    async def send(message: MutableMapping[str, Any]) -> None:
        said.append(message)

    asyncio.run(Guard(_inner, session)(scope, receive, send))
    if kind == "websocket":
        return said[0]["type"] == "websocket.accept", {}
    answer = {n.decode(): v.decode() for n, v in said[0]["headers"]}
    return said[0]["status"], answer


# What a stranger tries -> what it changes of a request of ours, and the status that answers it.
HTTP: dict[str, tuple[dict[str, str | None], dict[str, Any], int]] = {
    "a rebinding host": ({"host": f"evil.example:{PORT}"}, {}, 421),
    "a rebinding host with its own origin": (
        {"host": f"evil.example:{PORT}", "origin": f"http://evil.example:{PORT}"}, {}, 421,
    ),
    "our name without its port": ({"host": "127.0.0.1"}, {}, 421),
    "another port's name": ({"host": "127.0.0.1:80"}, {}, 421),
    "no host": ({"host": None}, {}, 421),
    "a foreign origin": ({"origin": "https://evil.example"}, {}, 403),
    "another local port, with the cookie": ({"origin": "http://127.0.0.1:9000"}, {}, 403),
    "our other name as origin": ({"origin": f"http://localhost:{PORT}"}, {}, 403),
    "an opaque origin": ({"origin": "null"}, {}, 403),
    "another local port by its site": ({"sec-fetch-site": "same-site"}, {}, 403),
    "a foreign site": ({"sec-fetch-site": "cross-site"}, {}, 403),
    "an address typed for the API": ({"sec-fetch-site": "none"}, {}, 403),
    "no word of the site": ({"sec-fetch-site": None}, {}, 403),
    "no cookie": ({"cookie": None}, {}, 401),
    "a wrong cookie": ({"cookie": f"{SESSION.cookie}=x"}, {}, 401),
    "the cookie of another port": ({"cookie": f"flightid-9000={SESSION.secret}"}, {}, 401),
    "a cookie no jar takes": ({"cookie": "a=\x00;;="}, {}, 401),
    "a link from a foreign page": (
        {"sec-fetch-site": "cross-site", "cookie": None}, {"path": "/"}, 401,
    ),
    "a form": ({"content-type": "application/x-www-form-urlencoded"}, {"method": "POST"}, 415),
    "plain text that is JSON": ({"content-type": "text/plain"}, {"method": "PATCH"}, 415),
    "no type": ({}, {"method": "PUT"}, 415),
    "a preflight": ({}, {"method": "OPTIONS"}, 405),
    "a trace": ({}, {"method": "TRACE"}, 405),
    "a long document": (
        {**JSON, "content-length": str(DOCUMENT_BYTES + 1)}, {"method": "POST"}, 413,
    ),
    "2 GB": (
        {"content-type": "application/octet-stream", "content-length": str(2_000_000_000)},
        {"method": "PUT"}, 413,
    ),
    "a length that is none": ({**JSON, "content-length": "-1"}, {"method": "POST"}, 413),
}  # fmt: skip
SOCKETS: dict[str, dict[str, str | None]] = {
    "a socket without origin": {},
    "a socket of another port": {"origin": "http://127.0.0.1:9000"},
    "a socket of a foreign page": {"origin": "https://evil.example"},
    "a socket without the cookie": {"origin": f"http://127.0.0.1:{PORT}", "cookie": None},
    "a rebinding socket": {
        "origin": f"http://evil.example:{PORT}", "host": f"evil.example:{PORT}",
    },
    "a socket of another site": {
        "origin": f"http://127.0.0.1:{PORT}", "sec-fetch-site": "cross-site",
    },
}  # fmt: skip


def test_what_a_stranger_tries_is_refused() -> None:
    found = {name: _asked(head, **how)[0] for name, (head, how, _) in HTTP.items()}
    assert found == {name: status for name, (_, _, status) in HTTP.items()}
    opened = [name for name, head in SOCKETS.items() if _asked(head, kind="websocket")[0]]
    assert not opened


def test_the_page_itself_is_answered_under_all_its_names() -> None:
    for host in SESSION.hosts:
        headers: dict[str, str | None] = {"host": host, "origin": f"http://{host}"}
        assert _asked(headers)[0] == 200
        assert _asked({**headers, **JSON}, method="POST")[0] == 200
        assert _asked({**headers, "sec-fetch-site": None}, kind="websocket")[0]
    # The first page may be typed or reloaded, by whoever has the cookie.
    assert _asked({"sec-fetch-site": "none"}, path="/")[0] == 200


def test_every_answer_carries_the_policy() -> None:
    for headers in ({}, {"origin": "https://evil.example"}, {"host": "x"}):
        _, answer = _asked(headers)
        assert HEADERS.items() <= answer.items()
        assert "access-control-allow-origin" not in answer
    assert POLICY.startswith("default-src 'none'; script-src 'self';")
    assert "frame-ancestors 'none'" in POLICY
    assert "unsafe-eval" not in POLICY


def test_a_token_is_worth_one_cookie() -> None:
    session = Session(PORT)
    first: dict[str, str | None] = {"cookie": None, "sec-fetch-site": "cross-site"}

    def enter(token: str, **more: str | None) -> tuple[Any, dict[str, str]]:
        head = {**first, **more}
        return _asked(head, path="/", query=f"token={token}", session=session)

    assert enter("x" * len(session.token))[0] == 403
    assert enter(session.token, host="evil.example")[0] == 421
    status, answer = enter(session.token)
    assert status == 200
    assert answer["set-cookie"] == (
        f"flightid-{PORT}={session.secret}; Path=/; HttpOnly; SameSite=Strict"
    )
    assert session.token not in answer["set-cookie"]
    assert enter(session.token)[0] == 403
    # Who is in may reload the link.
    assert enter(session.token, cookie=f"{session.cookie}={session.secret}")[0] == 200


def test_a_body_without_a_length_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flightid.app.guard.UPLOAD_BYTES", 1000)
    head: dict[str, str | None] = {"content-type": "application/octet-stream"}
    for more, status in ((0, 200), (1, 499)):
        body = (b"x" * 600, b"x" * (400 + more), b"")
        assert _asked(head, method="PUT", body=body)[0] == status
    assert UPLOAD_BYTES == 1 << 30


def test_cookies_of_other_pages_lock_nobody_out() -> None:
    for other in ('prefs={"a":1}', "a[1]=x", "n=ü", "a=\x00;;=", f"{SESSION.cookie}=bad", "="):
        for line in (f"{other}; {COOKIE}", f"{COOKIE};{other}"):
            assert _asked({"cookie": line})[0] == 200
        assert _asked({"cookie": f"x{COOKIE}; {other}"})[0] == 401
        assert _asked({"cookie": f'a="; {SESSION.cookie}={SESSION.secret}x; "; {other}'})[0] == 401


def test_a_document_that_is_handed_over_whole_is_sandboxed_and_nothing_else_is_let_out() -> None:
    def answered(*given: tuple[bytes, bytes]) -> list[str]:
        """Policies of an answer whose application sets these headers."""
        said = Messages()

        async def inner(scope: Any, receive: Any, send: Any) -> None:
            await send({"type": "http.response.start", "status": 200, "headers": list(given)})

        async def send(message: MutableMapping[str, Any]) -> None:
            said.append(message)

        head = [(n.encode(), v.encode()) for n, v in OURS.items()]
        scope = {
            "type": "http",
            "method": "GET",
            "path": "/x",
            "query_string": b"",
            "headers": head,
        }
        asyncio.run(Guard(inner, SESSION)(scope, _nothing, send))
        names = [n for n, _ in said[0]["headers"]]
        assert all(names.count(each.encode()) == 1 for each in HEADERS)
        return [v.decode() for n, v in said[0]["headers"] if n == b"content-security-policy"]

    policy = b"content-security-policy"
    assert answered() == [POLICY]
    assert answered((policy, SANDBOXED.encode())) == [SANDBOXED]
    for loose in (b"script-src *", SANDBOXED.encode() + b" ", b"", b"sandbox allow-scripts"):
        assert answered((policy, loose)) == [POLICY]
        assert answered((policy, SANDBOXED.encode()), (policy, loose)) == [SANDBOXED]
    parts = [part.split() for part in SANDBOXED.split(";")]
    assert ["sandbox"] in parts  # without a word behind it: no script, no form, no origin of ours
    assert ["default-src", "'none'"] in parts
    assert not any(part[0].startswith(("script-src", "connect-src")) for part in parts)


async def _nothing() -> MutableMapping[str, Any]:
    return {"type": "http.request", "body": b"", "more_body": False}


def test_a_second_host_is_refused() -> None:
    headers = {name: [value] for name, value in OURS.items()}
    scope = {"type": "http", "method": "GET", "path": "/api/workspace"}
    guard = Guard(_inner, SESSION)
    assert guard.refusal(scope, headers) is None
    for hosts in ([OURS["host"], "evil.example"], [OURS["host"]] * 2):
        refused = guard.refusal(scope, {**headers, "host": hosts})
        assert refused is not None
        assert refused.status == 421
    assert _asked({**JSON, "content-length": "9" * 5000}, method="POST")[0] == 413
