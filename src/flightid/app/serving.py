"""The server on the loopback, from its port to its end."""

from __future__ import annotations

import asyncio
import socket
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path

import uvicorn

from flightid.app.guard import DOCUMENT_BYTES, Guard, Session
from flightid.app.own_folders import own_folder, read_plain
from flightid.app.page import page_files
from flightid.app.server import make_server
from flightid.app.workspace import Workspace
from flightid.errors import OptionError
from flightid.files import write_atomically

LOOPBACK = "127.0.0.1"
PORT_BYTES = 16


def serve(folder: Path, port: int, *, say: Callable[[str], None], opens: bool) -> None:
    """Serve the page until somebody ends it.

    Parameters
    ----------
    folder : Path
        Workspace.
    port : int
        0: the one that this folder had before, where it is free: a browser keeps by address
        layouts and colours. Else any free one.
    say : callable
        Takes the address.
    opens : bool
        Whether to open the browser.

    Raises
    ------
    OptionError
        The port is taken, the page is not in this installation, or the folder is none.
    """
    page = page_files()
    workspace = Workspace(folder)
    bound = bound_socket(port) if port else bound_again(workspace.folder)
    session = Session(bound.getsockname()[1])
    server = server_of(workspace, page, session)
    say(f"flightid serves {workspace.folder} to this machine alone; Ctrl-C ends it.")
    say("The address opens once, in one browser; for another, end this and start it again:")
    say(session.address)
    if opens:
        threading.Timer(0.3, webbrowser.open, (session.address,)).start()
    asyncio.run(server.serve(sockets=[bound]))


def server_of(
    workspace: Workspace, page: dict[str, tuple[str, bytes]], session: Session
) -> uvicorn.Server:
    """The server behind its guard, not started yet."""
    config = uvicorn.Config(
        Guard(make_server(workspace, page), session),
        log_level="error",
        access_log=False,
        server_header=False,
        proxy_headers=False,
        ws="websockets-sansio",
        ws_max_size=DOCUMENT_BYTES,
        timeout_graceful_shutdown=3,
    )
    return uvicorn.Server(config)


def bound_again(folder: Path) -> socket.socket:
    """A socket on the loopback, of the port that the page of a folder had before if it is free.

    Raises
    ------
    OptionError
        No port is free, or the folder that the page keeps for itself is a link.
    """
    note = own_folder(folder, ".flightid") / "port"
    try:
        known = int(read_plain(note, PORT_BYTES))
    except (OSError, ValueError):
        known = 0
    try:
        bound = bound_socket(known if 1024 <= known <= 65535 else 0)
    except OptionError:
        bound = bound_socket(0)
    write_atomically(note, str(bound.getsockname()[1]))
    return bound


def bound_socket(port: int) -> socket.socket:
    """A socket on the loopback.

    Raises
    ------
    OptionError
        The port is taken.
    """
    bound = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((LOOPBACK, port))
        bound.listen()
    except OSError as error:
        bound.close()
        raise OptionError(
            "the port cannot be taken",
            found=f"{port}: {error.strerror}",
            needed="a port that is free",
            action="leave out port=… for any free one",
        ) from error
    return bound
