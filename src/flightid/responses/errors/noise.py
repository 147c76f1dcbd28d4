"""Noise spectra of the outputs: what the inputs do not explain, without leakage.

A gust moves all outputs of a vehicle at once, so their noise hangs together; errors that are taken
as independent would count one cause as many.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.responses.errors.noise_levels import NoiseLevels
from flightid.responses.errors.rising_noise import octaves, sure_slope
from flightid.responses.windows.local_fit import (
    ORDER,
    Bins,
    around,
    bins_needed,
    fit_locally,
    local_residuals,
)
from flightid.responses.windows.samples import Samples

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

LEAST_NOISE = 1e-12
"""Share of its first estimate below which noise is rounding."""
AVERAGED = 15
"""Bins, of all records together, over which residuals of a model that leaves noise are averaged."""
LEAST_NEIGHBOURS, FEWEST_VALUES = 3, 12
"""Bins of each record, and values of all records together, whose mean stands for a bin of noise
near a light mode."""
BEYOND_BAND = 1.5
"""Noise is estimated up to this multiple of the highest frequency of the response."""


@dataclass(frozen=True)
class NoiseSpectrum:
    """One-sided noise spectra of the outputs on a grid of their own.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n,)
    density : ndarray, shape (n_out, n)
        unit² per Hz, positive.
    coherency : ndarray of complex, shape (n, n_out, n_out), optional
        Cross-spectra over the roots of both densities, conjugate on the first index, with ones on
        the diagonal; without it the noises are independent.
    levels : tuple of NoiseLevels or None, length n_out
        What each density was estimated from; empty where that is not known.
    """

    omega_rad_s: Real
    density: Real
    coherency: Complex | None = None
    levels: tuple[NoiseLevels | None, ...] = ()

    @classmethod
    def of_matrices(
        cls, omega_rad_s: Real, matrices: Complex, freedom: Real | None = None
    ) -> NoiseSpectrum:
        """From spectral matrices, shape (n, n_out, n_out), conjugate on the first index.

        `freedom`, shape (n,), tells how many independent real numbers each matrix was made of,
        where no two share any.
        """
        density = np.real(np.einsum("nii->ni", matrices))
        root = np.sqrt(np.maximum(density, np.finfo(float).tiny))
        coherency = matrices / (root[:, :, None] * root[:, None, :])
        places = np.arange(density.shape[1])
        coherency[:, places, places] = 1.0
        known = () if freedom is None else (NoiseLevels(omega_rad_s, freedom),) * len(places)
        return cls(omega_rad_s, np.maximum(density, 0.0).T, coherency, known)

    def levels_of(self, output: int) -> NoiseLevels | None:
        """What an output's density was estimated from; None where that is not known."""
        return self.levels[output] if self.levels else None

    def of(self, outputs: NDArray[np.intp]) -> NoiseSpectrum:
        """Of some outputs, in this order."""
        coherency = self.coherency
        if coherency is not None:
            coherency = coherency[:, outputs[:, None], outputs]
        levels = tuple(self.levels_of(int(output)) for output in outputs)
        return NoiseSpectrum(self.omega_rad_s, self.density[outputs], coherency, levels)

    def replaced(self, other: NoiseSpectrum, outputs: NDArray[np.intp]) -> NoiseSpectrum:
        """With another noise in some outputs; what these share with the others is left out.

        On the frequencies of both: a resonance is narrower than the first estimate's bands.
        """
        omega = np.union1d(self.omega_rad_s, other.omega_rad_s)
        density = self.at(omega)
        least = LEAST_NOISE * density[outputs]
        density[outputs] = np.maximum(other.at(omega), least)
        coherency = np.tile(np.eye(len(density), dtype=np.complex128), (density.shape[1], 1, 1))
        coherency[:, outputs[:, None], outputs] = other.coherency_at(omega)
        levels = [self.levels_of(place) for place in range(len(density))]
        for place, output in enumerate(outputs.tolist()):
            levels[output] = other.levels_of(place)
        return NoiseSpectrum(omega, density, coherency, tuple(levels))

    def no_less_than(self, other: NoiseSpectrum) -> NoiseSpectrum:
        """The larger density up to where another one ends, with its coherency there."""
        omega = np.union1d(self.omega_rad_s, other.omega_rad_s)
        density, coherency = self.at(omega), np.array(self.coherency_at(omega))
        low = omega <= other.omega_rad_s[-1]
        density[:, low] = np.maximum(density[:, low], other.at(omega[low]))
        coherency[low] = other.coherency_at(omega[low])
        return NoiseSpectrum(omega, density, coherency, self.levels)

    def on(self, omega_rad_s: Real) -> NoiseSpectrum:
        """On other frequencies."""
        coherency = None if self.coherency is None else self.coherency_at(omega_rad_s)
        return NoiseSpectrum(omega_rad_s, self.at(omega_rad_s), coherency, self.levels)

    def at(self, omega_rad_s: Real) -> Real:
        """Density between the grid's frequencies, log-linear; held beyond its ends."""
        logs = np.log(np.maximum(self.density, np.finfo(float).tiny))
        return np.exp([np.interp(omega_rad_s, self.omega_rad_s, row) for row in logs])

    def coherency_at(self, omega_rad_s: Real) -> Complex:
        """Coherency between the grid's frequencies, shape (n, n_out, n_out).

        Linear, so that matrices stay positive; held beyond the grid's ends.
        """
        if self.coherency is None:
            identity = np.eye(len(self.density), dtype=np.complex128)
            return np.broadcast_to(identity, (len(omega_rad_s), *identity.shape))
        last = len(self.omega_rad_s) - 1
        place = np.interp(omega_rad_s, self.omega_rad_s, np.arange(last + 1.0))
        below = np.minimum(place.astype(np.intp), max(last - 1, 0))
        share = (place - below)[:, None, None]
        above = np.minimum(below + 1, last)
        return np.asarray((1.0 - share) * self.coherency[below] + share * self.coherency[above])


@dataclass(frozen=True)
class NoiseOfRecords:
    """Noise spectra that are estimated when somebody asks for them: see `estimate_noise`."""

    samples: Samples
    omega: Real
    response: Complex

    @cached_property
    def spectrum(self) -> NoiseSpectrum:
        """The estimate."""
        return estimate_noise(self.samples, self.omega, self.response)


def require_bins(samples: Samples) -> None:
    """Refuse records that are too short for `estimate_noise`.

    Raises
    ------
    DataError
        They hold too few samples.
    """
    n_regressors = len(samples.excitations or samples.inputs)
    sizes = [(record.shape[1] - 1) // 2 for record in samples.records]
    _require(min(sizes), bins_needed(n_regressors, len(sizes)))


def _require(size: int, count: int) -> None:
    if size < count:
        raise DataError(
            "the records are too short for a noise spectrum",
            found=f"{size} Fourier bins",
            needed=f"{count}",
            action="use longer records, or covariance=False",
        )


def estimate_noise(samples: Samples, omega: Real, response: Complex) -> NoiseSpectrum:
    """Noise spectra from local polynomial fits on neighbouring groups of bins.

    With excitations, outputs and inputs are both fitted on them and the noise of ``y − H u`` is
    formed from their joint residual: fitting y on u would absorb what the loop feeds back.

    Parameters
    ----------
    samples : Samples
    omega : ndarray, shape (n_f,)
        Frequencies of `response`, rad/s.
    response : ndarray of complex, shape (n_out, n_in, n_f)
        Needed with excitations only.

    Raises
    ------
    DataError
        The records hold too few samples.

    Notes
    -----
    What remains of leakage is the part of third degree over a group of bins; a mode whose bandwidth
    is below a few bins of the record still raises the estimate there. Noise is taken to be
    stationary over all records.
    """
    joint = bool(samples.excitations)
    order = ("excitations", "inputs", "outputs") if joint else ("inputs", "outputs")
    rows = np.concatenate([np.arange(len(samples.records[0]))[samples.rows(k)] for k in order])
    n_regressors = len(samples.excitations if joint else samples.inputs)
    records = [Bins.of(record[rows], samples.sample_time_s) for record in samples.records]
    found = [
        (centre, _of_outputs(residual, joint, centre, omega, response), freedom)
        for centre, residual, freedom in _groups(records, n_regressors, float(omega[-1]))
    ]
    return _of_groups(found)


def noise_of_residuals(
    residuals: Sequence[Real],
    regressors: Sequence[Real],
    sample_time_s: float,
    highest_rad_s: float,
    resonant_rad_s: float = 0.0,
) -> NoiseSpectrum:
    """Noise spectra from what a model leaves of the outputs.

    A model takes out the motion whose leakage no local polynomial follows: modes narrower than a
    few bins, and vehicles that only a loop holds. What the regressors still explain, the model's
    own errors, is fitted locally and counts as no noise.

    Parameters
    ----------
    residuals : sequence of ndarray, each shape (n_out, n_samples)
        Measured less modelled outputs of each record.
    regressors : sequence of ndarray, each shape (n_regressors, n_samples)
        Inputs, or excitations of a closed loop.
    sample_time_s : float
    highest_rad_s : float
        Highest frequency of the response.
    resonant_rad_s : float
        Up to it gusts may pass through a mode that is narrower than a group of bins, which hardly
        shows in the group's mean: there noise is no less than that of single bins' neighbours.
    """
    records = [
        Bins.of(np.concatenate([given, left]), sample_time_s)
        for given, left in zip(regressors, residuals, strict=True)
    ]
    smooth = _of_groups(list(_groups(records, len(regressors[0]), highest_rad_s)))
    if not resonant_rad_s:
        return smooth
    bins = [Bins.of(left, sample_time_s) for left in residuals]
    return smooth.no_less_than(_of_neighbours(bins, resonant_rad_s))


def _of_neighbours(records: Sequence[Bins], highest_rad_s: float) -> NoiseSpectrum:
    """Means over each bin of the longest record and its neighbours in all records."""
    longest = max(records, key=lambda bins: len(bins.omega)).omega
    inside = longest[longest <= highest_rad_s]
    inside = inside if len(inside) else longest[:1]
    count = max(LEAST_NEIGHBOURS, -(-FEWEST_VALUES // len(records)))
    found = []
    for omega in inside:
        places = [around(bins, float(omega), count) for bins in records]
        values = np.concatenate(
            [bins.values[:, place] for bins, place in zip(records, places, strict=True)], axis=1
        )
        found.append((float(omega), values.conj() @ values.T / values.shape[1]))
    return _gather(found)


def mean_spectrum(
    residuals: Sequence[Real],
    sample_time_s: float,
    highest_rad_s: float,
    spent: Sequence[Real],
) -> NoiseSpectrum:
    """Noise spectra of residuals that hold nothing but noise, averaged over neighbouring bins.

    Parameters
    ----------
    residuals : sequence of ndarray, each shape (n_out, n_samples)
        Of each record.
    sample_time_s : float
    highest_rad_s : float
        Highest frequency that a model was fitted to.
    spent : sequence of ndarray, each shape (n_out, n_bins)
        Of each record, share of a bin's noise that the model of each output took.
    """
    records = [Bins.of(each, sample_time_s) for each in residuals]
    longest = max(records, key=lambda bins: len(bins.omega)).omega
    inside = longest[longest <= highest_rad_s]
    size = sum(int(np.count_nonzero(bins.omega <= highest_rad_s)) for bins in records)
    n_groups = max(1, size // AVERAGED)

    groups = np.array_split(inside, min(n_groups, len(inside)))
    pooled = _means(records, spent, groups)
    omega, values, taken = _of_group(records, spent, groups[0])
    slopes = sure_slope(omega, np.abs(values) ** 2 / (1.0 - taken))
    if np.all(slopes == 0.0):
        return pooled
    split = _means(records, spent, [*octaves(groups[0]), *groups[1:]])
    both = pooled.on(np.union1d(pooled.omega_rad_s, split.omega_rad_s))
    density = np.where((slopes < 0.0)[:, None], split.at(both.omega_rad_s), both.density)
    pairs = zip(slopes, split.levels, pooled.levels, strict=True)
    levels = tuple(low if slope < 0.0 else one for slope, low, one in pairs)
    return NoiseSpectrum(both.omega_rad_s, density, both.coherency, levels)


def _means(records: Sequence[Bins], spent: Sequence[Real], groups: Sequence[Real]) -> NoiseSpectrum:
    """Mean spectra over groups of bins, each output's by what was not spent on it."""
    centres = np.array([0.5 * (group[0] + group[-1]) for group in groups])
    matrices, freedom = [], []
    for group in groups:
        _, values, taken = _of_group(records, spent, group)
        left = values.shape[1] - taken.sum(axis=1)
        root = np.sqrt(left)
        matrices.append(values.conj() @ values.T / np.outer(root, root))
        freedom.append(2.0 * left)
    found = NoiseSpectrum.of_matrices(centres, np.array(matrices))
    levels = tuple(NoiseLevels(centres, each) for each in np.array(freedom).T)
    return NoiseSpectrum(centres, found.density, found.coherency, levels)


def _of_group(
    records: Sequence[Bins], spent: Sequence[Real], group: Real
) -> tuple[Real, Complex, Real]:
    """Bins of all records within a group's span, their values, and what of them was spent."""
    low, high = group[0] * (1 - 1e-9), group[-1] * (1 + 1e-9)
    parts = [(b.omega >= low) & (b.omega <= high) for b in records]
    each = list(zip(records, spent, parts, strict=True))
    return (
        np.concatenate([b.omega[p] for b, _, p in each]),
        np.concatenate([b.values[:, p] for b, _, p in each], axis=1),
        np.concatenate([taken[:, p[: taken.shape[1]]] for _, taken, p in each], axis=1),
    )


def _gather(found: Sequence[tuple[float, Complex]]) -> NoiseSpectrum:
    matrices = np.array([matrix for _, matrix in found])
    return NoiseSpectrum.of_matrices(np.array([centre for centre, _ in found]), matrices)


def _of_groups(found: Sequence[tuple[float, Complex, float]]) -> NoiseSpectrum:
    """Of groups that share no bin; a complex number of freedom is two real ones."""
    centres, matrices, freedom = (np.array(part) for part in zip(*found, strict=True))
    return NoiseSpectrum.of_matrices(centres, matrices, 2.0 * freedom)


def _groups(
    records: Sequence[Bins], n_regressors: int, highest_rad_s: float
) -> Iterator[tuple[float, Complex, float]]:
    """Centre of each group of neighbouring bins, residual and freedom of its local fit."""
    count = bins_needed(n_regressors, len(records))
    size = min(len(bins.omega) for bins in records)
    _require(size, count)
    at_longest = int(np.argmax([len(bins.omega) for bins in records]))
    longest = records[at_longest]
    # A window's side lobes beyond this are far below its main lobe; the last density is held there.
    stride = max(count, len(longest.omega) * count // size)
    edges = np.append(longest.omega[::stride], np.inf)
    inside_band = int(np.searchsorted(edges, BEYOND_BAND * highest_rad_s))
    edges = edges[: max(inside_band + 1, 2)]
    # Records of one length share their bins.
    cuts = {len(bins.omega): np.searchsorted(bins.omega, edges * (1 - 1e-12)) for bins in records}
    ends = [cuts[len(bins.omega)].tolist() for bins in records]
    groups = []
    for number in range(len(edges) - 1):
        places = [slice(*end[number : number + 2]) for end in ends]
        if sum(place.stop - place.start for place in places) >= 0.9 * count * len(records):
            groups.append(places)
    alike = [group[0] for group in groups if group[0].stop - group[0].start == count]
    if len(cuts) > 1:
        alike = []
    at_once = dict(enumerate(local_residuals(records, alike, n_regressors)))
    unknowns = (ORDER + 1) * (n_regressors + len(records))
    for number, places in enumerate(groups):
        inside = longest.omega[places[at_longest]]
        centre = float(0.5 * (inside[0] + inside[-1]))
        residual = at_once.get(number)
        freedom = max(sum(place.stop - place.start for place in places) - unknowns, 1)
        if residual is None:
            fitted = fit_locally(records, places, centre, n_regressors)
            residual, freedom = fitted.residual, fitted.freedom
        yield centre, residual, float(freedom)


def _of_outputs(
    residual: Complex, joint: bool, centre: float, omega: Real, response: Complex
) -> Complex:
    if not joint:
        return residual
    n_out = response.shape[0]
    nearest = int(np.argmin(np.abs(omega - centre)))
    combine = np.concatenate([-response[:, :, nearest], np.eye(n_out)], axis=1)
    # residual has its conjugate on the first index.
    return np.asarray(combine.conj() @ residual @ combine.T)
