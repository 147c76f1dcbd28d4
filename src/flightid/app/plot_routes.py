"""Answers about plots of a flight: layouts by name, filters tried on its noise."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import FastAPI, HTTPException
from fastapi import Path as InPath

from flightid.app import filter_work
from flightid.app.backstage import Backstage, LogName, known_log, made
from flightid.app.plot_layouts import keep_layout, plot_layouts, remove_layout
from flightid.app.plot_schemas import LAYOUT_NAME, FilterRequest, FilterScreen, PlotLayout


def add_plot_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the plots of the screen Flight ask."""
    workspace = backstage.workspace

    @app.get("/api/layouts")
    async def listing() -> list[PlotLayout]:
        return await asyncio.to_thread(plot_layouts, workspace)

    @app.post("/api/layouts")
    async def keep(layout: PlotLayout) -> list[PlotLayout]:
        await asyncio.to_thread(keep_layout, workspace, layout)
        return await asyncio.to_thread(plot_layouts, workspace)

    @app.post("/api/filters/{log}")
    async def filters(log: LogName, asked: FilterRequest) -> FilterScreen:
        """What edited filters would make of the noise of a flight."""
        path = known_log(workspace, log)
        call = backstage.workers.compared(filter_work.try_filters, path, asked.values)
        return FilterScreen(**await made(call))

    @app.delete("/api/layouts/{name}")
    async def remove(name: Annotated[str, InPath(pattern=LAYOUT_NAME)]) -> list[PlotLayout]:
        if not await asyncio.to_thread(remove_layout, workspace, name):
            raise HTTPException(404, "There is no layout of this name.")
        return await asyncio.to_thread(plot_layouts, workspace)
