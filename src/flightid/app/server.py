"""The server: what the page asks for, answered from the workspace and from the workers."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError

from flightid.app.backstage import Backstage
from flightid.app.compare_routes import add_compare_routes
from flightid.app.draft_routes import add_draft_routes
from flightid.app.field_routes import add_field_routes
from flightid.app.fleet_routes import add_fleet_routes
from flightid.app.fly_routes import add_fly_routes
from flightid.app.gain_answers import add_gain_routes
from flightid.app.job_routes import add_job_routes
from flightid.app.jobs import Workers
from flightid.app.live import add_socket
from flightid.app.log_routes import add_log_routes
from flightid.app.model_routes import add_model_routes
from flightid.app.page_routes import add_page_routes
from flightid.app.plot_routes import add_plot_routes
from flightid.app.removed_routes import add_removed_routes
from flightid.app.rig_routes import add_rig_routes
from flightid.app.run_routes import add_run_routes
from flightid.app.studies import Studies
from flightid.app.study_compare_routes import add_study_compare_routes
from flightid.app.study_routes import add_study_routes
from flightid.app.workspace import Workspace
from flightid.errors import FlightidError
from flightid.version import VERSION

ROUTES: tuple[Callable[[FastAPI, Backstage], None], ...] = (
    add_log_routes,
    add_removed_routes,
    add_field_routes,
    add_plot_routes,
    add_job_routes,
    add_study_routes,
    add_draft_routes,
    add_gain_routes,
    add_compare_routes,
    add_study_compare_routes,
    add_rig_routes,
    add_run_routes,
    add_fly_routes,
    add_model_routes,
    add_fleet_routes,
    add_socket,
)
"""One module each; a new subject adds its own."""


def make_server(workspace: Workspace, page: Mapping[str, tuple[str, bytes]]) -> FastAPI:
    """Everything that is answered; `Guard` stands before it.

    Parameters
    ----------
    workspace : Workspace
    page : mapping of str to (str, bytes)
        Files of the page with their types.
    """
    workers = Workers(workspace)

    @asynccontextmanager
    async def lifespan(served: FastAPI) -> AsyncIterator[None]:
        del served
        workers.start()
        yield
        await asyncio.to_thread(workers.stop)
        workspace.index.close()

    app = FastAPI(
        title="flightid",
        version=VERSION,
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        lifespan=lifespan,
    )
    for refused in (FlightidError, OSError, RequestValidationError):
        app.add_exception_handler(refused, _refused)
    backstage = Backstage(workspace, Studies(workspace), workers)
    for add_routes in ROUTES:
        add_routes(app, backstage)
    add_page_routes(app, page)  # last: it takes every path that is left
    return app


async def _refused(request: Request, error: Exception) -> Response:
    """The sentence of a refusal, in ASCII: what was sent may be no text that has a UTF-8."""
    del request
    said = str(error)
    if isinstance(error, RequestValidationError):
        places = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()]
        said = "; ".join(places)
    return Response(json.dumps({"error": said}), 422, media_type="application/json")
