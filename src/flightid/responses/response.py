"""The frequency response: what a record says of a vehicle before any model is chosen."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, ShapeError, UnknownNameError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.record.digest import RecordDigest
from flightid.record.history import Step
from flightid.record.hold import InputShape
from flightid.responses.bands import choose_frequencies, nearest
from flightid.responses.errors.linear_estimate import LinearEstimate
from flightid.responses.errors.random_error import CovarianceSource, ErrorSelection
from flightid.responses.excited_band import excited_band, median_percent, summary_notes
from flightid.responses.injected_power import InjectedPower
from flightid.responses.pair import PairResponse, quotient_unit
from flightid.responses.shown import shown_values
from flightid.result import Result
from flightid.table import Column, Table
from flightid.uncertainty.feedback_result import FeedbackTest
from flightid.units import DIMENSIONLESS

SMALL_COVARIANCE = 1 << 25
"""Largest number of elements that `FrequencyResponse.covariance` builds without being asked."""


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse(
    Result,
    schema="flightid.frequency_response/1",
    untold={"errors": "for fits", "linear": "for arithmetic", "injected": "for the next sweep"},
):
    """Frequency responses of all outputs to all inputs with coherence, error and spectra.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_f,)
        Frequencies, increasing, rad/s.
    inputs, outputs : tuple of str
        Channel names.
    units : mapping of str to str
        Unit by channel name.
    response : ndarray of complex, shape (n_out, n_in, n_f)
        Output over input, in the unit of the output over that of the input.
    coherence : ndarray, shape (n_out, n_in, n_f)
        Partial coherence γ²: each input with the others taken out.
    multiple_coherence : ndarray, shape (n_out, n_f)
        Share of an output's power that the inputs explain together.
    random_error : ndarray, shape (n_out, n_in, n_f)
        Normalised random error of the magnitude, 1 σ; that of the phase in rad is the same.
    input_spectrum : ndarray of complex, shape (n_in, n_in, n_f), optional
        One-sided spectra, unit² per Hz; ``[i, j]`` has the conjugate on i.
    cross_spectrum : ndarray of complex, shape (n_out, n_in, n_f), optional
        One-sided spectra of input and output, conjugate on the input.
    output_spectrum : ndarray, shape (n_out, n_f), optional
        One-sided auto-spectra of the outputs, unit² per Hz.
    n_windows : tuple of int
        Windows averaged, for each length.
    n_independent : ndarray, shape (n_out, n_in, n_f)
        Number of independent windows that the random error rests on.
    window_s : tuple of float
        Window lengths, s.
    estimator : str
        How it was estimated.
    findings : tuple of Finding
        What to know before it is used.
    history : tuple of Step
        What was done.
    errors : CovarianceSource, optional
        What `covariance_at` asks.
    loop : FeedbackTest, optional
        Whether a loop was closed, tested or declared; None after arithmetic and where it was given.
    input_shape : InputShape
        What the records know of their inputs between samples.
    digests : sequence of RecordDigest
        Of the records that it was estimated from.
    injected_rad_s : (float, float), optional
        Lowest and highest frequency of what was injected, where records hold that.
    injected : mapping of str to InjectedPower
        By input: how strongly each frequency was injected, where records hold that.
    linear : LinearEstimate, optional
        The estimate as weights on the measured outputs, from which a fit computes its bias; None
        after arithmetic, from a file, and where it was given.

    Example
    -------
    >>> import numpy as np
    >>> response = FrequencyResponse.from_values([1.0, 2.0], 1 / (1 + 1j * np.array([1.0, 2.0])),
    ...                                          inputs=["tau"], outputs=["p"])
    >>> response
    FrequencyResponse(1 output x 1 input, 2 frequencies 1 to 2 rad/s, mean coherence 1.00)
    """

    omega_rad_s: NDArray[np.float64]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]
    response: NDArray[np.complex128]
    coherence: NDArray[np.float64]
    multiple_coherence: NDArray[np.float64]
    random_error: NDArray[np.float64]
    n_independent: NDArray[np.float64]
    input_spectrum: NDArray[np.complex128] | None = None
    cross_spectrum: NDArray[np.complex128] | None = None
    output_spectrum: NDArray[np.float64] | None = None
    n_windows: tuple[int, ...] = ()
    window_s: tuple[float, ...] = ()
    estimator: str = "given"
    findings: tuple[Finding, ...] = ()
    history: tuple[Step, ...] = ()
    errors: CovarianceSource | None = field(default=None)
    linear: LinearEstimate | None = field(default=None)
    loop: FeedbackTest | None = None
    input_shape: InputShape = field(default_factory=InputShape)
    digests: Sequence[RecordDigest] = ()
    injected_rad_s: tuple[float, float] | None = None
    injected: Mapping[str, InjectedPower] = field(default_factory=dict)

    def __post_init__(self) -> None:
        sizes = {"o": len(self.outputs), "i": len(self.inputs), "f": len(self.omega_rad_s)}
        for name, axes in AXES.items():
            value = getattr(self, name)
            if value is None:
                continue
            needed = tuple(sizes[axis] for axis in axes)
            array = np.array(value)
            if array.shape != needed:
                raise ShapeError(f"{name} does not fit", found=array.shape, needed=needed)
            if not np.all(np.isfinite(array)):
                raise DataError(f"{name} holds a value that is not finite", needed="finite numbers")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if np.any(np.diff(self.omega_rad_s) <= 0.0) or np.any(self.omega_rad_s <= 0.0):
            raise DataError("frequencies must be positive and increase", needed="rad/s, sorted")

    @classmethod
    def from_values(
        cls,
        omega_rad_s: ArrayLike,
        response: ArrayLike,
        *,
        inputs: Iterable[str],
        outputs: Iterable[str],
        units: Mapping[str, str] | None = None,
        coherence: ArrayLike | None = None,
        random_error: ArrayLike | None = None,
        errors: CovarianceSource | None = None,
        estimator: str = "given",
    ) -> FrequencyResponse:
        """Response from known values: a published table, a model, another tool's export.

        Parameters
        ----------
        omega_rad_s : array_like, shape (n_f,)
            Frequencies, rad/s.
        response : array_like of complex, shape (n_out, n_in, n_f) or (n_f,)
            Output over input.
        inputs, outputs : iterable of str
            Channel names.
        units : mapping of str to str, optional
            Unit by channel name; dimensionless where left out.
        coherence, random_error : array_like, optional
            In the shape of `response`; default 1 and 0.
        errors : CovarianceSource, optional
        estimator : str

        Raises
        ------
        ShapeError
            Shapes do not agree.
        """
        omega = np.atleast_1d(np.asarray(omega_rad_s, dtype=np.float64))
        names_in, names_out = tuple(inputs), tuple(outputs)
        shape = (len(names_out), len(names_in), len(omega))
        values = np.array(response, dtype=np.complex128)
        if values.size != np.prod(shape):
            raise ShapeError("response does not fit", found=values.shape, needed=shape)
        gamma2 = np.ones(shape) if coherence is None else np.reshape(coherence, shape)
        return cls(
            omega_rad_s=omega,
            inputs=names_in,
            outputs=names_out,
            units={name: (units or {}).get(name, DIMENSIONLESS) for name in names_in + names_out},
            response=values.reshape(shape),
            coherence=gamma2,
            multiple_coherence=gamma2.max(axis=1),
            random_error=np.zeros(shape)
            if random_error is None
            else np.reshape(random_error, shape),
            n_independent=np.ones(shape),
            errors=errors,
            estimator=estimator,
        )

    @property
    def n_frequencies(self) -> int:
        """Number of frequencies."""
        return len(self.omega_rad_s)

    @cached_property
    def shown(self) -> FrequencyResponse:
        """The estimate that tables, pictures and bands show: with leakage taken out.

        Its errors are those of its bars, its coherence is no more than they allow, and its findings
        tell what of the windows' coherence was leakage. Spectra stay those of the windows, errors
        are by input. The response itself where its records are gone, or it has no errors. A fit
        takes the response itself, and the leakage out of it by the model it fits.
        """
        return replace(self, **shown_values(self))

    @property
    def covariance(self) -> NDArray[np.float64] | None:
        """Covariance at all frequencies as from `covariance_at`, (n_out, 2 n_in n_f, 2 n_in n_f).

        None where the errors are not known. Built anew each time.

        Raises
        ------
        DataError
            The matrix would be large: choose frequencies with `select` or `covariance_at`.
        """
        if self.errors is None:
            return None
        elements = len(self.outputs) * (2 * len(self.inputs) * self.n_frequencies) ** 2
        if elements > SMALL_COVARIANCE:
            raise DataError(
                "the covariance at all frequencies is too large to build",
                found=f"{elements} elements",
                needed=f"at most {SMALL_COVARIANCE}",
                action="select the frequencies that are fitted, or use covariance_at",
            )
        return self.covariance_at(self.omega_rad_s)

    def covariance_at(self, omega_rad_s: ArrayLike) -> NDArray[np.float64]:
        """Covariance of the response at chosen frequencies, across frequencies and inputs.

        Parameters
        ----------
        omega_rad_s : array_like, shape (n,)
            Frequencies of this response, rad/s; the nearest one is taken for each.

        Returns
        -------
        ndarray, shape (n_out, 2 n_in n, 2 n_in n)
            For each output, real parts (first input at all frequencies, second input, …) and then
            imaginary parts in the same order, in squared units of the response.

        Raises
        ------
        DataError
            The errors of this response are not known.
        """
        if self.errors is None:
            raise DataError(
                "the errors of this response are not known",
                found=f"estimator {self.estimator!r} without covariance",
                needed="a response estimated with covariance=True",
            )
        chosen = nearest(self.omega_rad_s, np.atleast_1d(np.asarray(omega_rad_s, dtype=float)))
        outputs, inputs = np.arange(len(self.outputs)), np.arange(len(self.inputs))
        return self.errors.covariance(outputs, inputs, chosen)

    def pair(self, output: str, input: str) -> PairResponse:
        """Response of one output to one input.

        Raises
        ------
        UnknownNameError
            There is no such channel.
        """
        row, column = self._index("output", output), self._index("input", input)
        unit = quotient_unit(self.units.get(output, "1"), self.units.get(input, "1"))
        response, coherence = self.response[row, column], self.coherence[row, column]
        about = response, coherence, self.random_error[row, column], self.injected.get(input)
        return PairResponse(output, input, unit, self.omega_rad_s, *about)

    def select(
        self,
        *,
        inputs: Iterable[str] | None = None,
        outputs: Iterable[str] | None = None,
        band_rad_s: tuple[float, float] | None = None,
        n_omega: int | None = None,
        omega_rad_s: ArrayLike | None = None,
    ) -> FrequencyResponse:
        """Copy with some outputs, inputs or frequencies; errors and spectra follow.

        Parameters
        ----------
        inputs, outputs : iterable of str, optional
            Names to keep, in this order.
        band_rad_s : (float, float), optional
            Lowest and highest frequency to keep, rad/s.
        n_omega : int, optional
            Keep of the band the frequencies nearest to so many log-spaced ones.
        omega_rad_s : array_like, optional
            Keep the frequencies nearest to these, rad/s, in place of a band.

        Raises
        ------
        UnknownNameError
            There is no such channel.
        DataError
            No frequency lies in the band.
        """
        rows = [self._index("output", name) for name in (outputs or self.outputs)]
        columns = [self._index("input", name) for name in (inputs or self.inputs)]
        chosen = choose_frequencies(self.omega_rad_s, omega_rad_s, band_rad_s, n_omega)
        axes = {"o": np.array(rows), "i": np.array(columns), "f": chosen}
        changes = {
            name: getattr(self, name)[np.ix_(*(axes[axis] for axis in letters))]
            for name, letters in AXES.items()
            if getattr(self, name) is not None
        }
        errors = None if self.errors is None else ErrorSelection(self.errors, *axes.values())
        return replace(
            self,
            **changes,
            outputs=tuple(self.outputs[k] for k in rows),
            inputs=tuple(self.inputs[k] for k in columns),
            errors=errors,
            linear=None if self.linear is None else self.linear.select(*axes.values()),
        )

    def summary(self) -> Table:
        """Table of the pairs as they are shown (`shown`): usable band, coherence, random error.

        In a closed loop the band ends where the power of what excited the input does.
        """
        known = self.shown
        columns = (
            *map(Column, ("output", "input", "unit")),
            Column("usable from", "rad/s"),
            Column("to", "rad/s"),
            *map(Column, ("in Hz", "mean coherence")),
            Column("median random error", "%"),
        )
        rows = []
        for output in self.outputs:
            for name in self.inputs:
                pair = known.pair(output, name)
                band = excited_band(known, output, name)
                rows.append(
                    (
                        output,
                        name,
                        pair.unit,
                        *(band or (None, None)),
                        None
                        if band is None
                        else f"{band[0] / math.tau:.3g} to {band[1] / math.tau:.3g}",
                        float(np.mean(pair.coherence)),
                        median_percent(pair.random_error),
                    )
                )
        return Table(repr(known), columns, tuple(rows), summary_notes(known))

    def _computed(self) -> dict[str, object]:
        return {"history": [str(step) for step in self.history]}

    def __repr__(self) -> str:
        """Size, band and mean coherence on one line."""
        n_out, n_in = len(self.outputs), len(self.inputs)
        return (
            f"FrequencyResponse({n_out} output{'s' * (n_out > 1)} x {n_in} input{'s' * (n_in > 1)},"
            f" {self.n_frequencies} frequencies {self.omega_rad_s[0]:.4g} to"
            f" {self.omega_rad_s[-1]:.4g} rad/s, mean coherence {np.mean(self.coherence):.2f})"
        )

    def _index(self, kind: str, name: str) -> int:
        names = self.outputs if kind == "output" else self.inputs
        if name not in names:
            raise UnknownNameError(
                f"there is no such {kind}", found=name, needed="one of " + ", ".join(names)
            )
        return names.index(name)


AXES = {
    "omega_rad_s": "f",
    "response": "oif",
    "coherence": "oif",
    "multiple_coherence": "of",
    "random_error": "oif",
    "n_independent": "oif",
    "input_spectrum": "iif",
    "cross_spectrum": "oif",
    "output_spectrum": "of",
}
