"""A known controller taken out of measured data: what was given to the bare vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from flightid.control.closed_loop.controller_blocks import beside, controller_blocks, moved_by
from flightid.control.loops.block import Block
from flightid.control.loops.connect import connect
from flightid.control.loops.elements import sum_of
from flightid.conventions import Role
from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.record import Channel, Record, Step
from flightid.responses import FrequencyResponse
from flightid.responses.opened import open_loops

Data = TypeVar("Data", Record, FrequencyResponse)
Logged = Literal["stick", "total"]


def open_loop(
    data: Data,
    controller: object,
    *,
    logged: Logged = "stick",
    maximum_step_s: float | None = None,
) -> Data:
    """Take a known controller out of a record or a response of the augmented vehicle.

    The controller stands as in `close_loop`: what it gives under the name of an input is added to
    that input, and an input that it reads is the stick before that.

    Of a record the controller is flown again through what was measured, limits and all. Each input
    becomes what the bare vehicle was given, stick and controller together; the stick is kept as
    excitation ``"<input>_stick"``, the controller's share as ``"<input>_controller"``. Fit the bare
    vehicle with the sticks as instruments (``excitations=``, ``estimator="instrument"``), since the
    controller feeds gusts and noise back into its own inputs.

    Of a response from the sticks all loops are opened at once: H = T (1 + V + F T)⁻¹, with its
    covariance carried to first order.

    Parameters
    ----------
    data : Record or FrequencyResponse
        Departures from trim, the controller at rest at the first sample; of a response, from all
        inputs that the controller moves to all outputs that it reads.
    controller : mapping, Block, sequence of blocks, model, LinearSystem or Interconnection
        As for `close_loop`.
    logged : {"stick", "total"}
        What a record's input channels hold: sticks, or what reached the actuators.
    maximum_step_s : float, optional
        Step of the controller's simulation, s; the record's samples when left out.

    Returns
    -------
    Record or FrequencyResponse
        As what was given.

    Raises
    ------
    UnknownNameError
        The controller moves or reads nothing of the data, or reads what was not measured.
    OptionError
        Another way of logging, or a response from what reached the actuators, which needs no loop
        to be opened.
    DataError
        The data are neither record nor response.
    SingularError
        The loops leave no trace of the vehicle at some frequency.

    Assumes
    -------
    A controller known without error that saw what was logged. Biased when its sensors had filters
    or delays that are not among its blocks, or when the record begins away from trim.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.4 (indirect identification); Mettler,
    Tischler & Kanade, *J. American Helicopter Society* 47 (2002), eq. 19, for one loop.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> omega = np.array([1.0, 3.0])
    >>> bare = 4.0 / (1j * omega + 1.0)
    >>> flown = fid.FrequencyResponse.from_values(
    ...     omega, bare / (1 + 0.5 * bare), inputs=["lat"], outputs=["p"])
    >>> opened = open_loop(flown, {"lat": {"p": 0.5}})
    >>> bool(np.allclose(opened.response[0, 0], bare))
    True
    """
    if logged not in ("stick", "total"):
        raise OptionError("what was logged is not known", found=logged, needed="stick or total")
    if isinstance(data, FrequencyResponse):
        if logged == "total":
            raise OptionError(
                "a response from what reached the actuators is that of the bare vehicle",
                needed="a response from the sticks",
            )
        return _of_response(data, controller)
    if isinstance(data, Record):
        return _of_record(data, controller, logged, maximum_step_s)
    raise DataError("no loop can be opened in this", found=type(data).__name__,
                    needed="a Record or a FrequencyResponse")  # fmt: skip


def _of_record(data: Record, controller: object, logged: Logged, step_s: float | None) -> Record:
    units = {name: channel.unit for name, channel in data.channels.items()}
    blocks = controller_blocks(controller, units)
    given = {name for block in blocks for name in block.outputs}
    inputs = [name for name in data.inputs if name in given]
    outputs = [name for name in data.channels if name not in data.inputs]
    moved = moved_by(blocks, inputs or data.inputs, outputs)
    # Signals of the controller's run: sticks by the inputs' names, as the controller reads them.
    known = f"{'stick' if logged == 'stick' else 'total'} as logged"
    adding = beside(blocks, moved)
    logs = {name: f"{name} {known}" for name in moved}
    other = {name: f"{name}_total" for name in moved}
    if logged == "stick":
        sums = [sum_of(other[n], n, f"{n}_controller") for n in moved]
        logs = {name: name for name in moved}
    else:
        sums = [sum_of(n, logs[n], f"-{n}_controller") for n in moved]
        other = {name: name for name in moved}
    outside = _outside([*adding, *sums], [*data.channels, *logs.values()])
    run = connect([*adding, *sums], inputs=outside, name="controller")
    source = _with_logged(data, logs)
    kept = [*other.values(), *(f"{n}_controller" for n in moved)]
    flown = run.simulate(source, outputs=kept, maximum_step_s=step_s)
    sticks = {n: data[n] if logged == "stick" else flown[n] for n in moved}
    totals = {n: flown[other[n]] if logged == "stick" else data[n] for n in moved}
    shares = {f"{n}_controller": flown[f"{n}_controller"] for n in moved}
    return _opened(data, sticks, totals, shares, logged)


def _outside(blocks: Sequence[Block], known: Sequence[str]) -> list[str]:
    given = {name for block in blocks for name in block.outputs}
    read = dict.fromkeys(n for block in blocks for n in block.inputs if n not in given)
    for name in read:
        if name not in known:
            raise UnknownNameError(
                "the controller reads what was not measured", found=repr(name),
                needed=f"one of {', '.join(known)}",
            )  # fmt: skip
    return list(read)


def _with_logged(data: Record, logs: dict[str, str]) -> Record:
    """Record with the logged totals under names of their own."""
    renamed = {new: old for old, new in logs.items() if new != old}
    if not renamed:
        return data
    channels = [Channel(new, data.channels[old].unit, Role.INPUT) for new, old in renamed.items()]
    kept = [channel for name, channel in data.channels.items() if name not in logs]
    samples = {new: data[old] for new, old in renamed.items()}
    return data.replace(samples, channels=[*kept, *channels], step=Step("rename", {}))


def _opened(
    data: Record,
    sticks: dict[str, NDArray[np.float64]],
    totals: dict[str, NDArray[np.float64]],
    shares: dict[str, NDArray[np.float64]],
    logged: Logged,
) -> Record:
    channels = list(data.channels.values())
    samples = dict(totals)
    for name, values in sticks.items():
        unit = data.channels[name].unit
        channels.append(Channel(f"{name}_stick", unit, Role.EXCITATION, "before the controller"))
        samples[f"{name}_stick"] = values
    for name, values in shares.items():
        unit = data.channels[name.removesuffix("_controller")].unit
        channels.append(Channel(name, unit, Role.OTHER, "the controller's share"))
        samples[name] = values
    moved = ", ".join(sticks)
    return data.replace(
        samples, channels=channels, step=Step("open_loop", {"inputs": moved, "logged": logged})
    )


def _of_response(data: FrequencyResponse, controller: object) -> FrequencyResponse:
    blocks = controller_blocks(controller, data.units)
    moved = moved_by(blocks, data.inputs, data.outputs)
    adding = beside(blocks, moved)
    outside = _outside(adding, [*data.inputs, *data.outputs])
    run = connect(adding, inputs=outside, outputs=[f"{n}_controller" for n in moved])
    found = run.frequency_response(data.omega_rad_s)
    n_out, n_in, n_f = data.response.shape
    feedback = np.zeros((n_in, n_out, n_f), dtype=np.complex128)
    forward = np.zeros((n_in, n_in, n_f), dtype=np.complex128)
    rows = [data.inputs.index(name) for name in moved]
    for place, name in enumerate(outside):
        if name in data.outputs:
            feedback[rows, data.outputs.index(name)] = found[:, place]
        else:
            forward[rows, data.inputs.index(name)] = found[:, place]
    return open_loops(data, feedback, forward)
