"""Answers about words that are typed and not stored yet."""

from __future__ import annotations

import asyncio

from fastapi import FastAPI

from flightid.app.backstage import Backstage
from flightid.app.draft_schemas import Drafts, PlacedDraft
from flightid.app.drafts import all_drafts, keep_draft


def add_draft_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what every field asks that a hand types into for longer than a moment."""
    turn = asyncio.Lock()

    @app.get("/api/drafts")
    async def listing() -> Drafts:
        return await asyncio.to_thread(all_drafts, backstage.workspace)

    @app.post("/api/drafts")
    async def keep(typed: PlacedDraft) -> PlacedDraft:
        """Write it, in the order in which it came; what the folder has there then."""
        async with turn:
            return await asyncio.to_thread(keep_draft, backstage.workspace, typed)
