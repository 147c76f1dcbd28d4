"""Answers: the files of the page itself."""

from __future__ import annotations

from collections.abc import Mapping

from fastapi import FastAPI, HTTPException, Response


def add_page_routes(app: FastAPI, page: Mapping[str, tuple[str, bytes]]) -> None:
    """Answer every path that nobody else has taken."""

    @app.get("/", include_in_schema=False)
    async def index() -> Response:
        return _file("index.html")

    @app.get("/{name:path}", include_in_schema=False)
    async def part(name: str) -> Response:
        # Browsers ask for this name where a page that is left at once names another.
        return _file("icon.svg" if name == "favicon.ico" else name)

    def _file(name: str) -> Response:
        if name not in page:
            raise HTTPException(404, "There is no such page.")
        kind, content = page[name]
        return Response(content, media_type=kind)
