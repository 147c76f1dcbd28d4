"""The excitation: designed inputs on one time base, with the properties that decide their worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, OptionError, ShapeError
from flightid.excitation.spectrum import (
    Spectrum,
    coherence_between,
    power_spectrum,
    smoothed_matrix,
)
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.units import canonical

COVERAGE_LEVEL_DB = -20.0
COVERAGE_POINTS = 400


@dataclass(frozen=True, eq=False, repr=False)
class Excitation(Result, schema="flightid.excitation/1"):
    """Designed inputs on a uniform time base that starts at zero.

    Attributes
    ----------
    signals : ndarray, shape (n_inputs, n_samples)
        Samples of each input, in `unit`, held between samples as an autopilot does.
    sample_time_s : float
        Time between samples, s.
    names : tuple of str
        Names of the inputs.
    unit : str
        Unit of the inputs.
    kind : str
        Which design, for example ``"sweep"``.
    band_rad_s : tuple of float
        Lowest and highest frequency that the design aims at, rad/s.
    options : mapping of str to str, float, int, bool or None
        Every choice of the design, units in the names; enough to make it again.
    findings : tuple of Finding
        What the design could not keep.

    Raises
    ------
    ShapeError
        `signals` is not two-dimensional, or its rows are not as many as `names`.
    DataError
        A sample is not finite.
    OptionError
        The sample time or the band has no meaning.

    Example
    -------
    >>> import numpy as np
    >>> Excitation(np.array([[0.0, 1.0, -1.0, 0.0]]), 0.5, ("u",), "1", "doublet", (1.0, 4.0))
    Excitation('doublet', 1 input, 4 samples, 2 Hz, 2 s, relative peak factor 1.00)
    """

    signals: NDArray[np.float64]
    sample_time_s: float
    names: tuple[str, ...]
    unit: str
    kind: str
    band_rad_s: tuple[float, float]
    options: Mapping[str, Cell] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        signals = np.array(self.signals, dtype=np.float64)
        if signals.ndim != 2 or signals.shape[0] != len(self.names) or signals.shape[1] < 2:
            raise ShapeError(
                "signals do not fit the names of the inputs",
                found=f"shape {signals.shape}",
                needed=f"shape ({len(self.names)}, two samples or more)",
            )
        if not np.all(np.isfinite(signals)):
            raise DataError("an excitation holds samples that are not finite")
        low, high = self.band_rad_s
        if not (self.sample_time_s > 0 and 0 <= low < high):
            raise OptionError(
                "sample time or band has no meaning",
                found=f"sample time {self.sample_time_s} s, band {low} to {high} rad/s",
                needed="a positive sample time and a band from low to high",
            )
        signals.flags.writeable = False
        object.__setattr__(self, "signals", signals)
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "unit", canonical(self.unit))
        object.__setattr__(self, "options", dict(self.options))

    @property
    def n_inputs(self) -> int:
        """Number of inputs."""
        return len(self.names)

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self.signals.shape[1])

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Stamps from zero, s, shape (n_samples,)."""
        return np.arange(self.n_samples, dtype=np.float64) * self.sample_time_s

    @property
    def duration_s(self) -> float:
        """Number of samples times sample time, s."""
        return self.n_samples * self.sample_time_s

    @property
    def by_name(self) -> dict[str, NDArray[np.float64]]:
        """Samples by input name, in `unit`; ``Record.from_excitation`` makes a record of all."""
        return dict(zip(self.names, self.signals, strict=True))

    @property
    def peak(self) -> NDArray[np.float64]:
        """Largest magnitude of each input, in `unit`, shape (n_inputs,)."""
        return np.asarray(np.max(np.abs(self.signals), axis=1))

    @property
    def rms(self) -> NDArray[np.float64]:
        """Root mean square of each input, in `unit`, shape (n_inputs,)."""
        return np.asarray(np.sqrt(np.mean(self.signals**2, axis=1)))

    @property
    def peak_factor(self) -> NDArray[np.float64]:
        """Relative peak factor (max - min) / (2 sqrt(2) rms) of each input, shape (n_inputs,).

        1 for a sine; the lower, the more power goes into the same amplitude (Klein & Morelli).
        """
        span = np.ptp(self.signals, axis=1)
        rms = self.rms
        if np.any(rms == 0):
            raise DataError(
                "an input without power has no peak factor",
                found=", ".join(name for name, r in zip(self.names, rms, strict=True) if r == 0),
                needed="inputs that are not zero throughout",
            )
        return np.asarray(span / (2 * np.sqrt(2) * rms))

    def spectrum(self) -> Spectrum:
        """One-sided power spectral densities at the bins of the record, unit²/Hz."""
        return power_spectrum(self.signals, self.sample_time_s, self.names, self.unit)

    def smoothed_spectrum(self, omega_rad_s: NDArray[np.float64] | None = None) -> Spectrum:
        """Power spectral densities averaged over third-octave bands, unit²/Hz.

        Parameters
        ----------
        omega_rad_s : ndarray, optional
            Frequencies, rad/s; default: 400 over everything that the record resolves.
        """
        omega = self._all_frequencies() if omega_rad_s is None else omega_rad_s
        matrix = smoothed_matrix(self.signals, self.sample_time_s, omega)
        return Spectrum(omega, np.real(np.einsum("iik->ik", matrix)), self.names, self.unit)

    def coverage(
        self,
        band_rad_s: tuple[float, float] | None = None,
        *,
        level_db: float = COVERAGE_LEVEL_DB,
    ) -> NDArray[np.float64]:
        """Share of a band (on a logarithmic axis) in which power lies near the spectrum's peak.

        Parameters
        ----------
        band_rad_s : tuple of float, optional
            Band, rad/s; default: the band of the design.
        level_db : float
            Least power below the peak of the smoothed spectrum, dB.

        Returns
        -------
        ndarray, shape (n_inputs,)
            Percent of the band.

        Raises
        ------
        OptionError
            The band does not lie between zero and half the sample rate.
        """
        low, high = self._band(band_rad_s)
        inside = np.geomspace(low, high, COVERAGE_POINTS)
        density = self.smoothed_spectrum(inside).density
        peak = np.maximum(np.max(density, axis=1), np.max(self.smoothed_spectrum().density, axis=1))
        enough = density >= peak[:, None] * 10 ** (level_db / 10)
        return np.asarray(100.0 * np.mean(enough, axis=1))

    def correlation(self) -> NDArray[np.float64]:
        """Correlation of the inputs over time at zero lag, shape (n_inputs, n_inputs)."""
        centred = self.signals - np.mean(self.signals, axis=1, keepdims=True)
        norms = np.linalg.norm(centred, axis=1)
        if np.any(norms == 0):
            raise DataError("an input that is constant has no correlation")
        return np.asarray((centred @ centred.T) / np.outer(norms, norms))

    def coherence(self, band_rad_s: tuple[float, float] | None = None) -> NDArray[np.float64]:
        """Coherence of each pair of inputs, averaged over a band, shape (n_inputs, n_inputs).

        Guide: at most 0.5, or a response cannot be told from the others' (Tischler & Remple).

        Parameters
        ----------
        band_rad_s : tuple of float, optional
            Band, rad/s; default: the band of the design.
        """
        omega = np.geomspace(*self._band(band_rad_s), COVERAGE_POINTS)
        matrix = smoothed_matrix(self.signals, self.sample_time_s, omega)
        return np.asarray(np.mean(coherence_between(matrix), axis=2))

    def summary(self) -> Table:
        """Table of the inputs: peak, rms, relative peak factor, coverage of the band."""
        columns = (
            Column("input"),
            Column("peak", self.unit),
            Column("rms", self.unit),
            Column("relative peak factor", digits=3),
            Column("coverage of band", "%", digits=3),
        )
        numbers = np.column_stack((self.peak, self.rms, self.peak_factor, self.coverage()))
        rows: tuple[tuple[Cell, ...], ...] = tuple(
            (name, *(float(number) for number in row))
            for name, row in zip(self.names, numbers, strict=True)
        )
        low, high = self.band_rad_s
        notes = [f"Band {low:.4g} to {high:.4g} rad/s; coverage above {COVERAGE_LEVEL_DB:g} dB."]
        if self.n_inputs > 1:
            apart = ~np.eye(self.n_inputs, dtype=bool)
            correlation = float(np.max(np.abs(self.correlation()[apart])))
            coherence = float(np.max(self.coherence()[apart]))
            notes.append(
                f"Between inputs: correlation at most {correlation:.2g}, "
                f"mean coherence at most {coherence:.2g}."
            )
        return Table(repr(self), columns, rows, (*notes, *map(str, self.findings)))

    def _computed(self) -> dict[str, object]:
        return {
            "peak_factor": self.peak_factor,
            "coverage_percent": self.coverage(),
            "correlation": self.correlation(),
            "coherence": self.coherence(),
        }

    def __repr__(self) -> str:
        """Kind, size and the relative peak factor on one line."""
        inputs = "1 input" if self.n_inputs == 1 else f"{self.n_inputs} inputs"
        worst = f"{np.max(self.peak_factor):.2f}" if np.all(self.rms > 0) else "none (no power)"
        return (
            f"Excitation({self.kind!r}, {inputs}, {self.n_samples} samples, "
            f"{1 / self.sample_time_s:.6g} Hz, {self.duration_s:.6g} s, "
            f"relative peak factor {worst})"
        )

    def _all_frequencies(self) -> NDArray[np.float64]:
        lowest = 2 * np.pi / self.duration_s
        return np.geomspace(lowest, np.pi / self.sample_time_s, COVERAGE_POINTS)

    def _band(self, band_rad_s: tuple[float, float] | None) -> tuple[float, float]:
        low, high = self.band_rad_s if band_rad_s is None else band_rad_s
        low = max(low, 2 * np.pi / self.duration_s) if band_rad_s is None else low
        nyquist = np.pi / self.sample_time_s
        if not 0 < low < high <= nyquist * (1 + 1e-9):
            raise OptionError(
                "band does not fit the excitation",
                found=f"{low:.4g} to {high:.4g} rad/s",
                needed=f"a band above zero and up to {nyquist:.4g} rad/s, half the sample rate",
            )
        return low, min(high, nyquist)
