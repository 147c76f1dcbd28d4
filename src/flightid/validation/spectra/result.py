"""Results of the spectrum side of validation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table


@dataclass(frozen=True, eq=False, repr=False)
class ResidualSpectra(Result, schema="flightid.residual_spectra/1"):
    """Spectra of residuals and their coherence with the inputs.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_f,)
        Frequencies, rad/s.
    inputs, outputs : tuple of str
        Channels.
    units : mapping of str to str
        Unit by channel.
    density, low, high : ndarray, shape (n_out, n_f)
        One-sided spectrum per Hz, and its 95 % chi-square interval.
    coherence, coherence_limit : ndarray, shape (n_out, n_in, n_f)
        Partial coherence of residual and input, and what chance exceeds in 5 % of cases.
    window_s : float
        Window, s.
    findings : tuple of Finding
        One for each pair.

    Example
    -------
    >>> import flightid as fid
    >>> rng = np.random.default_rng(0)
    >>> record = fid.Record.from_arrays(np.arange(2000) * 0.02,
    ...     inputs={"u": rng.normal(size=2000)}, outputs={"e": rng.normal(size=2000)})
    >>> fid.validation.residual_spectra(record)
    ResidualSpectra(1 output x 1 input, 100 frequencies, ... % coherent)
    """

    omega_rad_s: NDArray[np.float64]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]
    density: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    coherence: NDArray[np.float64]
    coherence_limit: NDArray[np.float64]
    window_s: float
    findings: tuple[Finding, ...] = ()

    @property
    def coherent_percent(self) -> NDArray[np.float64]:
        """Share of frequencies with significant coherence, shape (n_out, n_in)."""
        return np.asarray(100.0 * np.mean(self.coherence > self.coherence_limit, axis=2))

    def summary(self) -> Table:
        """Table by pair."""
        columns = (
            Column("residual"),
            Column("input"),
            Column("coherent frequencies", "%", 3),
            Column("largest coherence", digits=3),
            Column("at", "rad/s", 3),
        )
        rows: list[tuple[Cell, ...]] = []
        for row, output in enumerate(self.outputs):
            for column, name in enumerate(self.inputs):
                top = int(np.argmax(self.coherence[row, column]))
                rows.append(
                    (
                        output,
                        name,
                        float(self.coherent_percent[row, column]),
                        float(self.coherence[row, column, top]),
                        float(self.omega_rad_s[top]),
                    )
                )
        return Table(repr(self), columns, tuple(rows), tuple(map(str, self.findings)))

    def __repr__(self) -> str:
        """Size and the largest share of coherent frequencies on one line."""
        return (
            f"ResidualSpectra({len(self.outputs)} output{'s' * (len(self.outputs) != 1)} x "
            f"{len(self.inputs)} input{'s' * (len(self.inputs) != 1)}, "
            f"{len(self.omega_rad_s)} frequencies, at most {np.max(self.coherent_percent):.0f} "
            "% coherent)"
        )


@dataclass(frozen=True)
class Peak:
    """One peak of a measured spectrum beside the model's.

    Attributes
    ----------
    output : str
        Channel.
    omega_rad_s, density : float or None
        Measured peak; None where only the model has it.
    predicted_rad_s, predicted_density : float or None
        The model's peak; None where it has none near.

    Example
    -------
    >>> Peak("p", 2.0, 0.1, 2.1, 0.1).predicted_rad_s
    2.1
    """

    output: str
    omega_rad_s: float | None
    density: float | None
    predicted_rad_s: float | None
    predicted_density: float | None


@dataclass(frozen=True, eq=False, repr=False)
class SpectrumComparison(Result, schema="flightid.spectrum_comparison/1"):
    """Spectra of measured and predicted outputs.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_f,)
        Frequencies, rad/s.
    outputs : tuple of str
        Channels.
    units : mapping of str to str
        Unit by channel.
    measured, low, high : ndarray, shape (n_out, n_f)
        One-sided spectrum per Hz of the measurement, and its 95 % chi-square interval.
    predicted : ndarray, shape (n_out, n_f)
        Of the prediction.
    peaks : tuple of Peak
        Peaks of both, by output.
    window_s : float
        Window, s.
    findings : tuple of Finding
        One for each peak.

    Example
    -------
    >>> import flightid as fid
    >>> rng = np.random.default_rng(0)
    >>> record = fid.Record.from_arrays(np.arange(2000) * 0.02,
    ...     inputs={"u": rng.normal(size=2000)}, outputs={"y": rng.normal(size=2000)})
    >>> fid.validation.compare_spectra(record, record)
    SpectrumComparison(1 output, 100 frequencies, ... peaks matched)
    """

    omega_rad_s: NDArray[np.float64]
    outputs: tuple[str, ...]
    units: Mapping[str, str]
    measured: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    predicted: NDArray[np.float64]
    peaks: tuple[Peak, ...]
    window_s: float
    findings: tuple[Finding, ...] = ()

    def summary(self) -> Table:
        """Table by peak."""
        columns = (
            Column("output"),
            Column("measured peak", "rad/s", 3),
            Column("model's peak", "rad/s", 3),
            Column("measured frequency", "Hz", 3),
            Column("measured density", digits=3),
            Column("model's density", digits=3),
        )
        rows: list[tuple[Cell, ...]] = [
            (
                peak.output,
                peak.omega_rad_s,
                peak.predicted_rad_s,
                None if peak.omega_rad_s is None else peak.omega_rad_s / (2.0 * np.pi),
                peak.density,
                peak.predicted_density,
            )
            for peak in self.peaks
        ]
        none = () if rows else ("No peak of a measured spectrum stands out of its random error.",)
        return Table(repr(self), columns, tuple(rows), (*none, *map(str, self.findings)))

    def __repr__(self) -> str:
        """Size and how many peaks measurement and model share, on one line."""
        shared = sum(
            peak.omega_rad_s is not None and peak.predicted_rad_s is not None for peak in self.peaks
        )
        outputs = f"{len(self.outputs)} output{'s' * (len(self.outputs) != 1)}"
        return (
            f"SpectrumComparison({outputs}, {len(self.omega_rad_s)} frequencies, "
            f"{shared} of {len(self.peaks)} peaks matched)"
        )
