"""Mismatch envelopes: how far a model's response may lie from flight before a pilot notices.

The envelopes of maximum unnoticed added dynamics bound the ratio model over flight in gain and
phase. They are tightest between 1 and 4 rad/s, where pilots close their loops.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Light
from flightid.errors import DataError, ModelError, OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.models import model_of
from flightid.responses import FrequencyResponse
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.validation.verification.as_estimated import without_leakage

# Numerator and denominator in falling powers of s, and the delay of the phase bounds, s.
_GAIN_UPPER = ((3.16, 31.61, 22.79), (1.0, 27.14, 1.84), 0.0)
_GAIN_LOWER = ((0.095, 9.92, 2.15), (1.0, 11.6, 4.95), 0.0)
_PHASE_UPPER = ((68.89, 1100.12, -275.22), (1.0, 39.94, 9.99), -0.0059)
_PHASE_LOWER = ((475.32, 184100.0, 29460.0), (1.0, 11.66, 0.039), 0.0072)
_Bound = tuple[tuple[float, ...], tuple[float, ...], float]

LESS_LEAKAGE = ", the estimate's leakage taken out"
INSIDE_PERCENT = (60.0, 90.0)
"""Share of the band inside the envelopes: less is red, more is green."""


@dataclass(frozen=True, eq=False)
class Envelopes:
    """Bounds of the ratio model over flight.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_freqs,)
        Frequencies, rad/s.
    gain_upper_db, gain_lower_db : ndarray, shape (n_freqs,)
        Bounds of the gain, dB.
    phase_upper_deg, phase_lower_deg : ndarray, shape (n_freqs,)
        Bounds of the phase, deg.

    Example
    -------
    >>> float(round(muad_envelopes([1.0]).gain_upper_db[0], 2))
    2.74
    """

    omega_rad_s: NDArray[np.float64]
    gain_upper_db: NDArray[np.float64]
    gain_lower_db: NDArray[np.float64]
    phase_upper_deg: NDArray[np.float64]
    phase_lower_deg: NDArray[np.float64]


def muad_envelopes(omega_rad_s: ArrayLike) -> Envelopes:
    """Envelopes of maximum unnoticed added dynamics, delays of the phase bounds included.

    Parameters
    ----------
    omega_rad_s : array_like, shape (n_freqs,)
        Frequencies, rad/s, positive.

    Raises
    ------
    OptionError
        A frequency that is not positive.

    Reference
    ---------
    MIL-STD-1797A, Flying Qualities of Piloted Aircraft, section 4.1.11 (the
    envelopes of Wood & Hodgkinson, 1980).

    Example
    -------
    >>> bounds = muad_envelopes([2.0])
    >>> print(f"{bounds.phase_upper_deg[0]:.0f} {bounds.phase_lower_deg[0]:.0f}")
    19 -15
    """
    omega = np.atleast_1d(np.asarray(omega_rad_s, dtype=np.float64))
    if not np.all(np.isfinite(omega) & (omega > 0)):
        raise OptionError("envelopes need frequencies above zero", needed="positive rad/s")
    upper, lower = _bound(_GAIN_UPPER, omega), _bound(_GAIN_LOWER, omega)
    return Envelopes(
        omega,
        _decibel(upper),
        _decibel(lower),
        np.degrees(np.angle(_bound(_PHASE_UPPER, omega))),
        np.degrees(np.angle(_bound(_PHASE_LOWER, omega))),
    )


@dataclass(frozen=True, eq=False, repr=False)
class Mismatch(Result, schema="flightid.mismatch/1"):
    """A model's response over the measured one, judged by the envelopes.

    Attributes
    ----------
    names : tuple of str
        ``"output/input"`` of each pair.
    envelopes : Envelopes
        Bounds at the measured frequencies.
    gain_db, phase_deg : ndarray, shape (n_pairs, n_freqs)
        Ratio model over flight.
    judged : ndarray of bool, shape (n_pairs, n_freqs)
        Where the coherence carries a judgement.
    findings : tuple of Finding
        One for each pair.
    is_corrected : bool
        Whether the measured response is that without the leakage that its estimator makes of the
        model; else as it stands, leakage included.

    Example
    -------
    >>> import numpy as np
    >>> from flightid.responses import FrequencyResponse
    >>> from flightid.models.linear.linear_system import LinearSystem
    >>> lag = LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> omega = np.geomspace(0.5, 10.0, 20)
    >>> flown = FrequencyResponse.from_values(omega, [[1.1 * 2 / (2 + 1j * omega)]],
    ...                                       inputs=["u"], outputs=["y"])
    >>> mismatch(lag, flown)
    Mismatch(1 pair, 20 frequencies, worst 100 % inside)
    """

    names: tuple[str, ...]
    envelopes: Envelopes
    gain_db: NDArray[np.float64]
    phase_deg: NDArray[np.float64]
    judged: NDArray[np.bool_]
    findings: tuple[Finding, ...] = ()
    is_corrected: bool = False

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Whether gain and phase lie inside their envelopes, shape (n_pairs, n_freqs)."""
        bounds = self.envelopes
        gain = (self.gain_db <= bounds.gain_upper_db) & (self.gain_db >= bounds.gain_lower_db)
        phase = self.phase_deg <= bounds.phase_upper_deg
        return np.asarray(gain & phase & (self.phase_deg >= bounds.phase_lower_deg))

    @property
    def inside_percent(self) -> tuple[float | None, ...]:
        """Share of the judged frequencies inside, by pair; None where none is judged."""
        return tuple(
            100.0 * float(np.mean(inside[judged])) if np.any(judged) else None
            for inside, judged in zip(self.inside, self.judged, strict=True)
        )

    def summary(self) -> Table:
        """Table by pair."""
        columns = (
            Column("response"),
            Column("inside", "%", 3),
            Column("largest gain error", "dB", 3),
            Column("largest phase error", "deg", 3),
        )
        rows: list[tuple[Cell, ...]] = []
        for index, (name, share) in enumerate(zip(self.names, self.inside_percent, strict=True)):
            judged = self.judged[index]
            largest: tuple[Cell, ...] = (None, None)
            if share is not None:
                largest = tuple(
                    float(np.max(np.abs(part[index][judged])))
                    for part in (self.gain_db, self.phase_deg)
                )
            rows.append((name, share, *largest))
        return Table(repr(self), columns, tuple(rows), tuple(map(str, self.findings)))

    def _computed(self) -> dict[str, object]:
        return {"inside_percent": self.inside_percent}

    def __repr__(self) -> str:
        """Size and the worst share on one line."""
        pairs = "1 pair" if len(self.names) == 1 else f"{len(self.names)} pairs"
        shares = [share for share in self.inside_percent if share is not None]
        worst = f"worst {min(shares):.0f} % inside" if shares else "none judged"
        return f"Mismatch({pairs}, {self.envelopes.omega_rad_s.size} frequencies, {worst})"


def mismatch(
    source: object, responses: FrequencyResponse, *, minimum_coherence: float = 0.6
) -> Mismatch:
    """Compare a model's frequency response with a measured one inside the envelopes.

    Where the records behind the measurement are at hand, what its windows make of the model on the
    measured inputs is taken out, as in a fit: leakage is no fault of a model.

    Assumes: the envelopes come from piloted aircraft in up-and-away flight; for a small vehicle
    they say what a human pilot would notice, not what a controller needs.

    Parameters
    ----------
    source : Fit or model
        A fit, or anything with inputs, outputs and state_space() or frequency_response().
    responses : FrequencyResponse
        Measured; pairs that the model does not have, or does not fit, are left out.
    minimum_coherence : float
        Frequencies with less are neither judged nor drawn.

    Raises
    ------
    ModelError
        The object is no model.
    DataError
        Model and measurement share no pair.

    Reference
    ---------
    MIL-STD-1797A, Flying Qualities of Piloted Aircraft, section 4.1.11; Tischler & Remple,
    Aircraft and Rotorcraft System Identification, 2nd ed., section 11.5.

    Example
    -------
    >>> import numpy as np
    >>> from flightid.models.linear.linear_system import LinearSystem
    >>> lag = LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> omega = np.geomspace(0.5, 10.0, 20)
    >>> late = FrequencyResponse.from_values(
    ...     omega, [[2 / (2 + 1j * omega) * np.exp(-0.2j * omega)]], inputs=["u"], outputs=["y"])
    >>> mismatch(lag, late).findings[0].light.value
    'red'
    """
    inner = model_of(source)
    inputs = tuple(getattr(inner, "inputs", ()))
    outputs = tuple(getattr(inner, "outputs", ()))
    chosen = getattr(inner, "response_names", None)
    pairs = [
        (y, u)
        for y in responses.outputs
        for u in responses.inputs
        if y in outputs and u in inputs and (chosen is None or f"{y}/{u}" in chosen)
    ]
    computed = _model_response(inner, responses.omega_rad_s)
    pairs = [(y, u) for y, u in pairs if np.any(computed[outputs.index(y), inputs.index(u)])]
    corrected = without_leakage(inner, responses, [f"{y}/{u}" for y, u in pairs])
    kept, ratios, judged = [], [], []
    for y, u in pairs:
        own = computed[outputs.index(y), inputs.index(u)]
        measured = (corrected or responses).pair(y, u)
        if np.any(measured.response == 0):
            raise DataError(f"the measured response {y}/{u} is zero at a frequency")
        kept.append(f"{y}/{u}")
        ratios.append(own / measured.response)
        judged.append(measured.coherence >= minimum_coherence)
    if not kept:
        raise DataError(
            "model and measurement share no response",
            found=f"model {', '.join(outputs)} over {', '.join(inputs)}",
            needed=f"{', '.join(responses.outputs)} over {', '.join(responses.inputs)}",
        )
    ratio = np.array(ratios)
    draft = Mismatch(
        tuple(kept),
        muad_envelopes(responses.omega_rad_s),
        _decibel(ratio),
        np.degrees(np.angle(ratio)),
        np.array(judged),
        is_corrected=corrected is not None,
    )
    return replace(draft, findings=_findings(draft))


def _model_response(model: object, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    own = getattr(model, "frequency_response", None)
    if callable(own):
        return np.asarray(own(omega), dtype=np.complex128)
    matrices = getattr(model, "state_space", None)
    if not callable(matrices):
        raise ModelError(
            "the model has no frequency response",
            found=type(model).__name__,
            needed="a fit, or an object with frequency_response() or state_space()",
        )
    a, b, c, d, delays_s = matrices()
    s = 1j * omega
    resolvent = np.linalg.solve(
        s[:, None, None] * np.eye(a.shape[0]) - a, np.broadcast_to(b, (omega.size, *b.shape))
    )
    late = np.exp(-np.outer(delays_s, s))
    return np.asarray(np.moveaxis(c @ resolvent + d, 0, -1) * late[None, :, :])


def _bound(bound: _Bound, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    above, below, delay_s = bound
    s = 1j * omega
    return np.asarray(np.polyval(above, s) / np.polyval(below, s) * np.exp(-delay_s * s))


def _decibel(ratio: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.asarray(20 * np.log10(np.abs(ratio)))


def _findings(draft: Mismatch) -> tuple[Finding, ...]:
    poor, good = INSIDE_PERCENT
    found = []
    for name, share in zip(draft.names, draft.inside_percent, strict=True):
        if share is None:
            light, text = Light.UNKNOWN, f"{name}: no frequency is coherent enough to judge"
        else:
            light = Light.GREEN if share >= good else Light.AMBER if share >= poor else Light.RED
            text = f"{name}: {share:.0f} % of the band lies inside the mismatch envelopes"
            text += LESS_LEAKAGE if draft.is_corrected else ""
        action = "" if light is Light.GREEN else "look where the ratio leaves the envelopes"
        found.append(Finding("mismatch-envelopes", light, text, action))
    return tuple(found)
