"""The Python lines that do what a study says of a model's responses: to read, copy and run."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from flightid.logs import Log, read_log
from flightid.study.settings import Segment, Settings
from flightid.study.taking import channels_needed, sid_run
from flightid.study.task import Task, load_task


def python_lines(settings: Settings, model: str, folder: Path) -> str:
    """Lines that estimate the responses of a model as its study does.

    Parameters
    ----------
    settings : Settings
        Of a study of a log.
    model : str
        Name of one of its models.
    folder : Path
        Where the lines are meant to run; the path of the log is relative to it.

    Returns
    -------
    str
        Where records are conditioned first, or come from files, the lines run the study.
    """
    names = tuple(each.name for each in settings.models)
    tasks = [load_task(each, names) for each in settings.models]
    task = next(each for each in tasks if each.settings.name == model)
    if settings.log is None or settings.conditioning or settings.injected != ("excitation",):
        return 'import flightid as fid\n\nstudy = fid.run_study("study.toml")\nprint(study)\n'
    log = read_log(settings.log)
    relative = Path(os.path.relpath(settings.log, folder)).as_posix()
    return "\n".join(_lines(settings, tasks, task, log, relative)) + "\n"


def _lines(settings: Settings, tasks: list[Task], task: Task, log: Log, path: str) -> Iterator[str]:
    needed = channels_needed(settings, tasks)
    yield from ("import flightid as fid", "", f"log = fid.read_log({path!r})", "records = [")
    for name in task.settings.flown:
        segment = settings.segment(name)
        yield "    log.record("
        yield f"        names={list(needed[name])!r},"
        yield f"        roles={ {key: str(role) for key, role in needed[name].items()}!r},"
        yield f"        {_where(segment, log)},"
        for key in ("channel_map", "gaps", "max_gap_s", "sample_rate_hz"):
            value = getattr(settings, key)
            if value not in (None, "error"):
                yield f"        {'channels' if key == 'channel_map' else key}={value!r},"
        shape = segment.shape
        for key in ("hold", "period_s", "loop"):
            if getattr(shape, key) is not None:
                yield f"        {key}={getattr(shape, key)!r},"
        yield f"        name={name!r},"
        yield "    ),"
    yield from ("]", "response = fid.estimate_response(", "    records,")
    asked = task.settings.response
    yield f"    inputs={list(asked.moved(task.inputs))!r},"
    yield f"    outputs={list(task.settings.outputs or task.outputs)!r},"
    yield f"    band_rad_s={task.settings.band_rad_s!r},"
    for key, value in asked.of_verb(asked.estimators[0]).items():
        if value is not None:
            yield f"    {key}={list(value) if isinstance(value, tuple) else value!r},"
    yield from (")", "print(response.summary())")


def _where(segment: Segment, log: Log) -> str:
    if segment.span_s is not None:
        return f"span_s={segment.span_s!r}"
    return f"sid_run={log.sid_runs.index(sid_run(log, segment))}"
