"""Several loops broken at once: the matrix of a plant and its controller at inputs or outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from flightid.control.margins.loop_grid import Roots, loop_grid, roots_of, whole_grid
from flightid.control.margins.loop_source import (
    Controller,
    ResponseSource,
    closed_count,
    known_values,
)
from flightid.control.margins.usable_points import read_band_of_all, unread
from flightid.errors import DataError, ModelError, OptionError, ShapeError, UnknownNameError
from flightid.frozen import dataclass
from flightid.identification.uncertain_of import uncertain_of
from flightid.responses import FrequencyResponse
from flightid.responses.arithmetic import Known
from flightid.responses.errors.random_error import Points, combined
from flightid.responses.unbiased import unbiased
from flightid.uncertainty.uncertain import Uncertain

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
At = Literal["outputs", "inputs", "both"]
PLACES = ("outputs", "inputs", "both")
STEADY = np.array([1e-3, 1e-2, 1e-1])
"""Added below the lowest frequency, as shares of it."""


@dataclass(frozen=True, eq=False)
class MatrixLoop:
    """Loops broken together, negative feedback, with their uncertainty.

    Attributes
    ----------
    channels : tuple of str
        Where they are broken, n of them.
    uncertain : Uncertain
    omega_rad_s : ndarray, shape (n_f,)
    of : callable
        From the thing and frequencies to L, shape (n_f, n, n).
    unstable_poles : int
        Of the open loops.
    measured : bool
    closed_unstable_poles : int or None
        Of the closed loops, counted over all frequencies where a band holds only some of them.
    unread : str
        What of a measurement is not read, for want of coherence; empty where all is.
    """

    channels: tuple[str, ...]
    uncertain: Uncertain[Any]
    omega_rad_s: Array
    of: Callable[[Any, Array], Complex]
    unstable_poles: int
    measured: bool
    closed_unstable_poles: int | None = None
    unread: str = ""


@dataclass(frozen=True, eq=False)
class KnownLaw:
    """A controller of one loop given as function of s, values or a number."""

    law: Known
    outputs: tuple[str, ...] = ("law",)
    inputs: tuple[str, ...] = ("law",)

    def frequency_response(self, omega_rad_s: ArrayLike) -> Complex:
        """Response, shape (1, 1, n_f)."""
        return known_values(self.law, np.asarray(omega_rad_s, dtype=np.float64))[None, None]


def read_loops(
    source: object,
    outputs: Sequence[str] | None,
    inputs: Sequence[str] | None,
    *,
    controller: Controller | None,
    at: At,
    band_rad_s: tuple[float, float] | None,
    unstable_poles: int | None,
) -> MatrixLoop:
    """Read a plant and its controller, or loops that are broken already.

    Raises
    ------
    OptionError
        An unknown place to break the loops, or a place without a controller.
    ModelError
        The source has no frequency response.
    UnknownNameError
        There is no such channel.
    ShapeError
        Numbers of channels that do not fit.
    """
    controller = _asked(controller, at, band_rad_s)
    measured = isinstance(source, FrequencyResponse)
    if isinstance(source, FrequencyResponse):
        uncertain = _unweighed(_without_leakage(source))
    else:
        uncertain = uncertain_of(source)
    thing: Any = uncertain.value
    if not measured and not isinstance(thing, ResponseSource):
        raise ModelError(
            "the loop has no frequency response",
            found=type(source).__name__,
            needed="a model, a fit, a system, or a measurement",
        )
    rows, columns = _chosen(thing, outputs, inputs, controller)
    said = ""
    if isinstance(source, FrequencyResponse):
        thing, controller, said = _read_part(source.select(outputs=rows), thing, controller)
        uncertain = _unweighed(thing)
    known = tuple(thing.outputs), tuple(thing.inputs)
    places = np.ix_([known[0].index(n) for n in rows], [known[1].index(n) for n in columns])

    def of(model: Any, omega: Array) -> Complex:  # noqa: ANN401 — whatever is uncertain
        values = model.response if measured else model.frequency_response(omega)
        plant = np.moveaxis(np.asarray(values, dtype=np.complex128)[places], -1, 0)
        return plant if controller is None else _joined(plant, controller, omega, rows, columns, at)

    roots = (Roots() if measured else roots_of(thing)).joined(roots_of(controller))
    if measured:
        omega = thing.omega_rad_s
        if band_rad_s is not None:
            raise OptionError(
                "a measurement has its own band", needed="response.select(band_rad_s=…)"
            )
    else:
        omega = loop_grid(lambda at_: _determinant(of(thing, at_)), roots, band_rad_s)
        if band_rad_s is None:
            # Coupled loops may be weakest where nothing moves any more.
            omega = np.concatenate([omega[0] * STEADY, omega])
    names = {"outputs": rows, "inputs": columns, "both": rows + columns}[at]
    count = roots.n_unstable if unstable_poles is None else unstable_poles
    closed = None
    if band_rad_s is not None:

        def one_loop(at_: Array) -> Complex:
            return equivalent_loop(of(thing, at_))

        closed = closed_count(one_loop, whole_grid(one_loop, roots, band_rad_s), count)
    return MatrixLoop(names, uncertain, omega, of, count, measured, closed, said)


def _asked(
    controller: Controller | None, at: At, band_rad_s: tuple[float, float] | None
) -> ResponseSource | None:
    """The controller as a source of responses, once what was asked has a meaning."""
    if at not in PLACES:
        raise OptionError("at is not known", found=repr(at), needed="one of " + ", ".join(PLACES))
    if controller is None and at != "outputs":
        raise OptionError(
            "loops without a controller are broken where they are", found=at, needed="controller=…"
        )
    if band_rad_s is not None and not 0.0 < band_rad_s[0] < band_rad_s[1] < np.inf:
        raise OptionError("band_rad_s has no meaning", found=band_rad_s, needed="0 < low < high")
    if controller is None or isinstance(controller, ResponseSource):
        return controller
    return KnownLaw(controller)


def _read_part(
    measured: FrequencyResponse, clean: FrequencyResponse, controller: ResponseSource | None
) -> tuple[FrequencyResponse, ResponseSource | None, str]:
    """What is coherent of a measurement, a controller's values there, and what is not read."""
    omega = measured.omega_rad_s
    low, high = read_band_of_all(measured)
    said = unread(omega, (low, high))
    if not said:
        return clean, controller, said
    if isinstance(controller, KnownLaw) and isinstance(controller.law, np.ndarray | list | tuple):
        inside = (omega >= low) & (omega <= high)
        law = np.asarray(controller.law)
        controller = KnownLaw(law[inside]) if law.shape == omega.shape else controller
    return clean.select(band_rad_s=(low, high)), controller, said


def _without_leakage(response: FrequencyResponse) -> FrequencyResponse:
    """What was measured less what windows blur, as far as that can be foretold.

    Of several outputs the errors stay those of the estimate, which know what outputs share.
    """
    alone = len(response.outputs) == 1
    clean = unbiased(response, refined=alone)
    if clean is None or alone:
        return clean or response
    return replace(response, response=clean.response, linear=None)


def _determinant(loops: Complex) -> Complex:
    """det(I + L) − 1: one loop that turns about −1 as all of them do together."""
    return np.asarray(np.linalg.det(np.eye(loops.shape[1]) + loops) - 1.0)


def equivalent_loop(loops: Complex) -> Complex:
    """The single loop with the same closed-loop poles, shape (n_f,), never quite zero."""
    found = _determinant(loops)
    return np.asarray(np.where(found == 0.0, 1e-300, found))


def _unweighed(response: object) -> Uncertain[Any]:
    """A measurement whose covariance is worked out where it is needed, by `uncertain_at`."""
    return Uncertain.exact(response)


def uncertain_at(loops: MatrixLoop, omega: Array) -> Uncertain[Any]:
    """What the loops are computed from, with its errors; of a measurement at some frequencies.

    Parameters
    ----------
    loops : MatrixLoop
    omega : ndarray, shape (n,)
        Frequencies of the measurement, rad/s.

    Returns
    -------
    Uncertain
    """
    if not loops.measured:
        return loops.uncertain
    chosen: FrequencyResponse = loops.uncertain.value.select(omega_rad_s=omega)
    parts = [uncertain_of(chosen, output=name) for name in chosen.outputs]
    if len(parts) == 1:
        return parts[0]
    shape = chosen.response.shape

    def make(numbers: Array) -> FrequencyResponse:
        real, imaginary = np.moveaxis(numbers.reshape(shape[0], 2, *shape[1:]), 1, 0)
        return replace(chosen, response=real + 1j * imaginary)

    centre = np.concatenate([part.numbers for part in parts])
    unknown = next((part.reason for part in parts if not part.known), None)
    if unknown is not None:
        return Uncertain(centre, None, make, None, unknown)
    if chosen.errors is None:
        blocks = [np.asarray(part.covariance) for part in parts]
        return Uncertain(centre, scipy.linalg.block_diag(*blocks), make, None, parts[0].reason)
    rows = np.split(np.eye(len(centre)), len(parts), axis=1)
    points = [
        Points(k, np.arange(shape[1]), np.arange(shape[2])) for k in range(len(chosen.outputs))
    ]
    return Uncertain(centre, combined(chosen.errors, points, rows), make)


def _chosen(
    thing: Any,  # noqa: ANN401 — a model or a measurement
    outputs: Sequence[str] | None,
    inputs: Sequence[str] | None,
    controller: Any,  # noqa: ANN401
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Plant outputs and inputs: as given, else by the controller's names, else all."""
    found = []
    for kind, wanted, fed in (("outputs", outputs, "inputs"), ("inputs", inputs, "outputs")):
        known = tuple(getattr(thing, kind))
        names = tuple(wanted) if wanted is not None else tuple(getattr(controller, fed, known))
        if wanted is None and not set(names) <= set(known):
            names = known
        for name in names:
            if name not in known:
                raise UnknownNameError(
                    f"there is no such {kind[:-1]}", found=name, needed=", ".join(known)
                )
        found.append(names)
    rows, columns = found
    sizes = (len(columns), len(rows))
    if controller is None and sizes[0] != sizes[1]:
        raise ShapeError("loops are not square", found=sizes[::-1], needed="as many back as out")
    shape = len(getattr(controller, "outputs", columns)), len(getattr(controller, "inputs", rows))
    if controller is not None and shape != sizes:
        raise ShapeError(
            "the controller does not fit the plant",
            found=f"{shape[0]} outputs, {shape[1]} inputs",
            needed=f"{sizes[0]} outputs, {sizes[1]} inputs",
        )
    return rows, columns


def _joined(
    plant: Complex,
    controller: ResponseSource,
    omega: Array,
    rows: tuple[str, ...],
    columns: tuple[str, ...],
    at: At,
) -> Complex:
    law = np.asarray(controller.frequency_response(omega), dtype=np.complex128)
    known = tuple(getattr(controller, "outputs", ())), tuple(getattr(controller, "inputs", ()))
    if set(known[0]) == set(columns) and set(known[1]) == set(rows):
        law = law[np.ix_([known[0].index(n) for n in columns], [known[1].index(n) for n in rows])]
    law = np.moveaxis(law, -1, 0)
    if not np.all(np.isfinite(law)):
        raise DataError("the controller is not finite at a frequency", needed="finite values")
    if at == "outputs":
        return np.asarray(plant @ law)
    if at == "inputs":
        return np.asarray(law @ plant)
    # Outputs y and inputs u broken together: y = P u, u = −K y.
    n_y, n_u = len(rows), len(columns)
    both = np.zeros((len(omega), n_y + n_u, n_y + n_u), dtype=np.complex128)
    both[:, :n_y, n_y:] = -plant
    both[:, n_y:, :n_y] = law
    return both
