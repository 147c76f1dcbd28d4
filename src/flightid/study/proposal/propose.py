"""The verb: a study file for a log, or for records from files."""

from __future__ import annotations

import os
from collections.abc import Mapping, MutableMapping, Sequence
from pathlib import Path
from typing import Any

from flightid.errors import OptionError
from flightid.logs import is_log, is_table_too
from flightid.options import checked
from flightid.study.proposal.of_log import study_of_log
from flightid.study.proposal.of_records import study_of_records
from flightid.study.proposal.options import DataOptions, told
from flightid.study.proposal.proposal import Proposal


def propose_study(
    files: Sequence[str | Path],
    *,
    folder: str | Path,
    model: str | None = None,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    excitations: Sequence[str] = (),
    actuators: Mapping[str, float] | None = None,
    conditioning: Sequence[Mapping[str, Any]] = (),
    tune: bool = False,
    cache: MutableMapping[str, Any] | None = None,
    **reading: Any,  # noqa: ANN401 — fields of DataOptions
) -> Proposal:
    """Write the study that data ask for: what was flown says what can be identified, and how.

    Parameters
    ----------
    files : sequence of str or Path
        One log, or records in CSV, Parquet, MATLAB or netCDF.
    folder : str or Path
        Folder of the study file; paths in it are relative to that.
    model : str, optional
        Library model or model file in place of the usual one; for records, a model with equations
        in place of a structure that is looked for. A file as it is named here, or else beside the
        study.
    inputs, outputs : sequence of str
        Columns of records, where their names do not tell.
    excitations : sequence of str
        Columns of records that were injected ahead of a controller: instruments in a closed loop.
    actuators : mapping of str to float, optional
        Bandwidths, rad/s, of known first-order actuators that lie between a column and the input
        of `model`: they are taken out of the records.
    conditioning : sequence of mapping, optional
        Tables ``[[conditioning]]`` of a study of records, which structures are tried behind; their
        `records` are manoeuvres, ``FILE: MANOEUVRE``.
    tune : bool
        Let the study end in gains of the autopilot that flew.
    cache : mutable mapping of str to object, optional
        Takes what is read and found, of records also the scan of orders; given to `run_study`,
        nothing is done twice.
    **reading : object
        How records are read, and what is declared of inputs (of a log too): arguments of
        `flightid.read_records`.

    Returns
    -------
    Proposal

    Raises
    ------
    OptionError
        Several logs, or a log among records, or columns named for a log.
    FlightidError
        A file cannot be read.
    """
    paths = [Path(file) for file in files]
    asked = checked(DataOptions, reading, "a study of records")
    # Columns that are named are those of the topics of a bag, or of a decoded blackbox.
    roles = inputs or outputs or excitations or actuators or conditioning
    named = bool(roles or told(asked) != asked.declared)
    if model is not None and model.endswith(".toml") and Path(model).is_file():
        model = Path(os.path.relpath(model, folder)).as_posix()
    logs = [path for path in paths if is_log(path) and not (named and is_table_too(path))]
    if not logs:
        return study_of_records(
            paths,
            Path(folder),
            model=model,
            inputs=tuple(inputs),
            outputs=tuple(outputs),
            excitations=tuple(excitations),
            actuators=actuators or {},
            reading=asked,
            conditioning=conditioning,
            cache=cache,
        )
    if len(paths) > 1 or named:
        raise OptionError(
            "a log is taken alone, and its channels have names, units and stamps",
            found=", ".join(path.name for path in paths),
            needed="one log without options of tables, or records from files",
        )
    return study_of_log(
        logs[0], Path(folder), model=model, tune=tune, cache=cache, declared=asked.declared
    )
