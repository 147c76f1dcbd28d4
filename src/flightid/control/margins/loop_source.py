"""What margins are taken of: a broken loop with its uncertainty, from models or measurements."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.control.margins.loop_grid import loop_grid, roots_of, whole_grid
from flightid.control.margins.loop_metrics import LoopMetrics, loop_metrics
from flightid.control.margins.usable_points import read_band, unread
from flightid.errors import DataError, ModelError, OptionError, ShapeError, UnknownNameError
from flightid.frozen import dataclass
from flightid.identification.uncertain_of import uncertain_of
from flightid.models import Model, linear_system
from flightid.responses import FrequencyResponse
from flightid.responses.arithmetic import Known, apply_known, loop_of_sensitivity, open_loop
from flightid.responses.unbiased import unbiased
from flightid.uncertainty.uncertain import Uncertain

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Given = Literal["broken", "closed", "sensitivity"]
GIVEN = ("broken", "closed", "sensitivity")


@runtime_checkable
class ResponseSource(Protocol):
    """Anything with a frequency response, shape (n_out, n_in, n_f)."""

    def frequency_response(self, omega_rad_s: ArrayLike) -> Any:  # noqa: ANN401 — any array
        """Response at frequencies in rad/s."""
        ...


Controller = Known | ResponseSource
"""Known part of a loop: a model, a function of s = jω, values at the frequencies, or a gain."""


@dataclass(frozen=True, eq=False)
class BrokenLoop:
    """One broken loop, negative feedback, with its uncertainty.

    Attributes
    ----------
    name : str
        Output and input.
    uncertain : Uncertain
        Of what the loop is computed from.
    omega_rad_s : ndarray, shape (n_f,)
        Frequencies: of the measurement, or chosen for the model.
    of : callable
        From the thing and frequencies to the loop's response, shape (n_f,).
    unstable_poles : int
        Of the open loop.
    coherence : ndarray, shape (n_f,), or None
        Of a measured response.
    end_rad_s : float
        Highest frequency that has a meaning, rad/s: π/T of a sampled loop.
    closed_unstable_poles : int or None
        Of the closed loop, counted over all frequencies where the band holds only some of them.
    whole_rad_s : ndarray, shape (n_f,), or None
        All frequencies of a model's loop that the band cuts off, so that no limit is missed.
    unread : str
        What of a measurement is not read, for want of coherence; empty where all is.
    rigid : bool
        Whether the vehicle was declared to have no light mode outside the band of its model.
    """

    name: str
    uncertain: Uncertain[Any]
    omega_rad_s: Array
    of: Callable[[Any, Array], Complex]
    unstable_poles: int
    coherence: Array | None = None
    end_rad_s: float = np.inf
    closed_unstable_poles: int | None = None
    whole_rad_s: Array | None = None
    unread: str = ""
    rigid: bool = False

    @property
    def measured(self) -> bool:
        """Whether the response is known at its own frequencies alone."""
        return self.coherence is not None

    def metrics(self, omega: Array, values: Complex) -> LoopMetrics:
        """Margins of the loop's response at some frequencies."""
        return loop_metrics(
            omega,
            values,
            unstable_poles=self.unstable_poles,
            closed_unstable_poles=self.closed_unstable_poles,
        )


def read_loop(
    source: object,
    output: str | None,
    input: str | None,
    *,
    controller: Controller | None,
    given: Given,
    band_rad_s: tuple[float, float] | None,
    unstable_poles: int | None,
) -> BrokenLoop:
    """Read what a caller gave as a loop.

    Raises
    ------
    OptionError
        An unknown way of giving a loop, a band without meaning, or a closed loop given as a model.
    ModelError
        The source has no frequency response.
    DataError
        No frequencies in the band.
    UnknownNameError
        There is no such channel.
    """
    if given not in GIVEN:
        raise OptionError(
            "given is not known", found=repr(given), needed="one of " + ", ".join(GIVEN)
        )
    if band_rad_s is not None and not 0.0 < band_rad_s[0] < band_rad_s[1] < np.inf:
        raise OptionError("band_rad_s has no meaning", found=band_rad_s, needed="0 < low < high")
    if isinstance(source, FrequencyResponse):
        return _measured(source, output, input, controller, given, band_rad_s, unstable_poles or 0)
    if given != "broken":
        raise OptionError(
            "only a measured response may be given with its loop closed",
            found=f"{type(source).__name__} given as {given}",
            needed="given='broken'",
            action="give the plant and its controller",
        )
    return _modelled(source, output, input, controller, band_rad_s, unstable_poles)


def _measured(
    response: FrequencyResponse,
    output: str | None,
    input: str | None,
    controller: Controller | None,
    given: Given,
    band_rad_s: tuple[float, float] | None,
    unstable_poles: int,
) -> BrokenLoop:
    row = response.outputs[_place("output", output, response.outputs)]
    column = response.inputs[_place("input", input, response.inputs)]
    pair = response.select(inputs=[column], outputs=[row], band_rad_s=band_rad_s)
    if pair.n_frequencies < 3:
        raise DataError(
            "too few frequencies to find margins", found=pair.n_frequencies, needed="three or more"
        )
    band = read_band(pair)
    said = unread(pair.omega_rad_s, band)
    pair = unbiased(pair, refined=True) or pair
    if given == "closed":
        pair = open_loop(pair, 1.0)
    elif given == "sensitivity":
        pair = loop_of_sensitivity(pair)
    if controller is not None:
        pair = apply_known(pair, known_values(controller, pair.omega_rad_s))
        unstable_poles += roots_of(controller).n_unstable
    if said:
        # Last of all: a controller given as values has one at every frequency.
        pair = pair.select(band_rad_s=band)

    def of(thing: FrequencyResponse, omega: Array) -> Complex:
        del omega  # a measurement has its own
        return np.asarray(thing.response[0, 0])

    return BrokenLoop(
        f"{row} / {column}",
        uncertain_of(pair),
        pair.omega_rad_s,
        of,
        unstable_poles,
        pair.coherence[0, 0],
        unread=said,
    )


def _modelled(
    source: object,
    output: str | None,
    input: str | None,
    controller: Controller | None,
    band_rad_s: tuple[float, float] | None,
    unstable_poles: int | None,
) -> BrokenLoop:
    uncertain = uncertain_of(source)
    if isinstance(uncertain.value, Model) and not isinstance(uncertain.value, ResponseSource):
        uncertain = uncertain.then(linear_system)
    model = uncertain.value
    if not isinstance(model, ResponseSource):
        raise ModelError(
            "the loop has no frequency response",
            found=type(source).__name__,
            needed="a model, a fit, a system, a connection broken at a signal, or a measurement",
        )
    outputs, inputs = (tuple(getattr(model, kind, ("loop",))) for kind in ("outputs", "inputs"))
    row, column = _place("output", output, outputs), _place("input", input, inputs)

    def of(thing: ResponseSource, omega: Array) -> Complex:
        values = np.asarray(thing.frequency_response(omega), dtype=np.complex128)
        loop = values if values.ndim == 1 else values[row, column]
        return loop if controller is None else loop * known_values(controller, omega)

    if controller is not None and isinstance(controller, np.ndarray) and controller.ndim:
        raise ShapeError(
            "values of a controller have no frequencies of a model to stand at",
            found=controller.shape,
            needed="a function of s, a gain, or a model",
        )
    uncertain = uncertain.about([f"{outputs[row]}/{inputs[column]}"])
    roots = roots_of(model).joined(roots_of(controller))
    omega = loop_grid(lambda at: of(model, at), roots, band_rad_s)
    count = roots.n_unstable if unstable_poles is None else unstable_poles
    name = f"{outputs[row]} / {inputs[column]}"
    whole, closed = None, None
    if band_rad_s is not None:
        whole = whole_grid(lambda at: of(model, at), roots, band_rad_s)
        closed = closed_count(lambda at: of(model, at), whole, count)
    return BrokenLoop(name, uncertain, omega, of, count, None, roots.end_rad_s, closed, whole)


def closed_count(of: Callable[[Array], Complex], whole: Array, unstable_poles: int) -> int:
    """Unstable poles of a closed loop, counted below, in and above a band.

    Parameters
    ----------
    of : callable
        The loop's response, shape (n_f,).
    whole : ndarray, shape (n_f,)
        Of `whole_grid`, rad/s.
    unstable_poles : int
        Of the open loop.

    Returns
    -------
    int
        Below zero where the open loop must have more unstable poles.
    """
    found = loop_metrics(whole, of(whole), unstable_poles=unstable_poles)
    return round(float(found.unstable_poles))


def known_values(controller: Controller, omega: Array) -> Complex:
    """Response of a known single loop element, shape (n_f,).

    Raises
    ------
    ShapeError
        A controller of several channels, or values that are not as many as the frequencies.
    """
    if isinstance(controller, ResponseSource):
        found = np.asarray(controller.frequency_response(omega), dtype=np.complex128)
        if found.ndim == 3 and found.shape[:2] == (1, 1):
            found = found[0, 0]
    else:
        s = np.asarray(1j * omega, dtype=np.complex128)
        found = np.asarray(controller(s) if callable(controller) else controller, dtype=complex)
        found = np.full(omega.shape, complex(found)) if found.ndim == 0 else found
    if found.shape != omega.shape:
        raise ShapeError(
            "the controller does not fit the loop",
            found=found.shape,
            needed=f"one output, one input and {len(omega)} frequencies",
        )
    return found


def _place(kind: str, name: str | None, known: tuple[str, ...]) -> int:
    if name is None:
        if len(known) > 1:
            raise OptionError(
                f"the loop has several {kind}s", found=", ".join(known), needed=f"{kind}=…"
            )
        return 0
    if name not in known:
        raise UnknownNameError(f"there is no such {kind}", found=name, needed=", ".join(known))
    return known.index(name)
