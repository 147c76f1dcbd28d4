"""An estimate as what it is in its outputs: linear, with weights that the inputs have fixed.

Windows and polynomials resolve a finite band, so the expected estimate of a known model is not the
model's response but this functional of the model's outputs. The difference is the estimator's bias
(leakage and resolution), which more signal does not shrink; with the functional it can be computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ShapeError
from flightid.frozen import dataclass
from flightid.record import Record
from flightid.responses.errors.covariance import WindowedErrors
from flightid.responses.errors.functional import Functional, one_by_one
from flightid.responses.errors.local_errors import LocalErrors
from flightid.responses.errors.local_information import local_spread
from flightid.responses.errors.noise import NoiseSpectrum, noise_of_residuals
from flightid.responses.errors.pilot import Pilot, Pilots
from flightid.responses.errors.random_error import CovarianceSource, ErrorSelection
from flightid.responses.windows.halving import Halves
from flightid.responses.windows.local_fit import Bins, LocalFit
from flightid.responses.windows.samples import Samples
from flightid.responses.windows.transform import transform

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Places = NDArray[np.intp]
SAMPLED = 64
"""Samples from one that is looked at to the next, where a row may be zero throughout."""


class OutputWeights(Protocol):
    """The weights of an estimate on its outputs.

    `tells_parts`: a part of the records adds the share of the response that its power has.
    """

    tells_parts: ClassVar[bool]

    def functional(self, outputs: Places, inputs: Places, frequencies: Places) -> Functional:
        """The weights at some places, made ready to be applied again and again."""
        ...

    def errors_of(
        self, residuals: Sequence[Real], outputs: Places, resonant_rad_s: float = 0.0
    ) -> CovarianceSource | None:
        """Errors of the whole estimate with the noise of a model's residuals in some outputs.

        None where the estimate's own noise is as good.
        """
        ...

    def errors_with(self, noise: NoiseSpectrum, outputs: Places) -> CovarianceSource:
        """Errors of the whole estimate with another noise in some outputs, in their order."""
        ...

    def local_spread(self, inputs: Sequence[Real]) -> Real | None:
        """What bins beside a frequency tell by themselves, by the inputs of each record.

        See `flightid.responses.errors.local_information.local_spread`; None where the estimate
        itself is of these bins alone.
        """
        ...


@dataclass(frozen=True)
class WindowedWeights:
    """Weights of a windowed estimate; a composite to first order, its window shares held fixed.

    Attributes
    ----------
    errors : WindowedErrors
    """

    errors: WindowedErrors
    tells_parts: ClassVar[bool] = True

    def functional(self, outputs: Places, inputs: Places, frequencies: Places) -> Functional:
        """See `OutputWeights`."""
        windows = self.errors.windows
        bases = windows.bases(frequencies)
        weights = windows.weights_by(bases, inputs, frequencies)
        turns = self.errors.composite.sensitivity[:, :, :, outputs][:, :, :, :, inputs][
            ..., frequencies
        ]
        shape = (len(outputs), len(inputs), len(frequencies))

        def apply(changes: Sequence[Real]) -> Complex:
            ahead = changes[0].shape[:-2]
            rows = [each.reshape(-1, each.shape[-1]) for each in changes]
            moved = np.zeros((len(bases), len(rows[0]), *shape[1:]), dtype=np.complex128)
            for each, change in zip(weights, rows, strict=True):
                moves = _moving(change)
                # Halved once for windows of all lengths.
                halves = Halves(change if moves.size == len(change) else change[moves])
                places = slice(None) if moves.size == len(change) else moves
                for place, basis in enumerate(bases):
                    if not (moves.size and basis.plan.count(change.shape[1])):
                        continue
                    real, imaginary = transform(halves, basis)
                    window = (real + 1j * imaginary).transpose(0, 2, 1)
                    met = (each[place].transpose(1, 0, 2) @ window).transpose(2, 1, 0)
                    moved[place, places] += met
            total = np.zeros((2, *ahead, *shape))
            for turn, made in zip(turns, moved, strict=True):
                parts = np.stack([made.real, made.imag]).reshape(2, *ahead, *shape)
                total += np.einsum("aboif,b...oif->a...oif", turn, parts)
            return np.asarray(total[0] + 1j * total[1])

        return apply

    def errors_of(
        self, residuals: Sequence[Real], outputs: Places, resonant_rad_s: float = 0.0
    ) -> CovarianceSource | None:
        """See `OutputWeights`."""
        step = self.errors.sample_time_s
        highest = float(self.errors.windows.omega[-1]) / step
        instruments = self.errors.windows.instruments
        noise = noise_of_residuals(residuals, instruments, step, highest, resonant_rad_s)
        return self.errors_with(noise, outputs)

    def errors_with(self, noise: NoiseSpectrum, outputs: Places) -> CovarianceSource:
        """See `OutputWeights`; the other outputs keep their noise, as independent."""
        return replace(self.errors, known_noise=self.errors.noise.replaced(noise, outputs))

    def local_spread(self, inputs: Sequence[Real]) -> Real | None:
        """See `OutputWeights`."""
        windows, step = self.errors.windows, self.errors.sample_time_s
        return local_spread(inputs, windows.instruments, windows.omega / step, step)


def _moving(rows: Real) -> Places:
    """Rows that are not zero throughout.

    Example
    -------
    >>> _moving(np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0]])).tolist()
    [1, 2]
    """
    found = np.any(rows[:, ::SAMPLED], axis=1)  # of most rows that tells already
    still = np.flatnonzero(~found)
    # Coefficients that do not act in a record stand side by side: one look at all of them.
    for block in np.split(still, np.flatnonzero(np.diff(still) > 1) + 1):
        some = rows[block[0] : block[-1] + 1] if block.size else rows[:0]
        if np.any(some):
            found[block] = np.any(some, axis=1)
    return np.flatnonzero(found)


@dataclass(frozen=True)
class LocalWeights:
    """Weights of local polynomial estimates on the Fourier bins of whole records.

    Attributes
    ----------
    fits : tuple of LocalFit
    sample_time_s : float
    noise : NoiseSpectrum
        At the estimate's frequencies.
    """

    fits: tuple[LocalFit, ...]
    sample_time_s: float
    noise: NoiseSpectrum
    tells_parts: ClassVar[bool] = True

    def functional(self, outputs: Places, inputs: Places, frequencies: Places) -> Functional:
        """See `OutputWeights`."""
        fits = [self.fits[frequency] for frequency in frequencies]

        def apply(changes: Sequence[Real]) -> Complex:
            found = np.zeros((len(outputs), len(inputs), len(fits)), dtype=np.complex128)
            for index, change in enumerate(changes):
                if not np.any(change):
                    continue
                values = Bins.of(change, self.sample_time_s).values
                for place, fit in enumerate(fits):
                    bins = values[:, fit.places[index]]
                    found[:, :, place] += bins @ fit.weights[index][inputs].T
            return found

        return one_by_one(apply)

    def errors_of(
        self, residuals: Sequence[Real], outputs: Places, resonant_rad_s: float = 0.0
    ) -> CovarianceSource | None:
        """None: local polynomials have taken the leakage out of their noise already."""
        del residuals, outputs, resonant_rad_s
        return None

    def errors_with(self, noise: NoiseSpectrum, outputs: Places) -> CovarianceSource:
        """See `OutputWeights`; the other outputs keep their noise, as independent."""
        known = self.noise.replaced(noise, outputs)
        return LocalErrors(self.fits, known.on(self.noise.omega_rad_s))

    def local_spread(self, inputs: Sequence[Real]) -> Real | None:
        """See `OutputWeights`."""
        del inputs
        return None


@dataclass(frozen=True)
class LinearEstimate:
    """What a response was estimated from, and the weights by which.

    Attributes
    ----------
    weights : OutputWeights
    inputs : tuple of str
        Names of all inputs that the estimate was conditioned on.
    input_records, output_records : tuple of ndarray, shapes (n_inputs, n) and (n_outputs, n)
        Measured samples, one array for each record, means removed as for the estimate.
    sample_time_s : float
    places : tuple of ndarray of int
        Outputs, inputs and frequencies of the estimate that the response holds.
    pilots : Pilots
        Models of all outputs that foretell the estimate's bias.
    excited : tuple of Record
        Where the estimate goes straight from inputs to outputs: its records, if they hold an
        excitation for each input, by way of which it could have gone.

    Example
    -------
    >>> import numpy as np, flightid as fid
    >>> u = np.random.default_rng(0).standard_normal(2000)
    >>> record = fid.Record.from_arrays(np.arange(2000) / 100, inputs={"u": u},
    ...                                 outputs={"y": np.convolve(u, [0.5, 0.5])[:2000]})
    >>> response = fid.estimate_response(record, band_rad_s=(2.0, 50.0), n_omega=5)
    >>> again = response.linear.apply([record.matrix(["y"])])
    >>> bool(np.allclose(again, response.response, rtol=0.01))
    True
    """

    weights: OutputWeights
    inputs: tuple[str, ...]
    input_records: tuple[Real, ...]
    output_records: tuple[Real, ...]
    sample_time_s: float
    places: tuple[Places, Places, Places]
    pilots: Pilots
    excited: tuple[Record, ...] = ()

    @classmethod
    def of(cls, samples: Samples, weights: OutputWeights, omega_rad_s: Real) -> LinearEstimate:
        """All outputs, inputs and frequencies of an estimate from `samples`."""
        sizes = (len(samples.outputs), len(samples.inputs), len(omega_rad_s))
        places = tuple(np.arange(size) for size in sizes)
        inputs, outputs = tuple(samples.part("inputs")), tuple(samples.part("outputs"))
        step = samples.sample_time_s
        return cls(
            weights,
            samples.inputs,
            inputs,
            outputs,
            step,
            (places[0], places[1], places[2]),
            Pilots(
                inputs,
                outputs,
                step,
                float(omega_rad_s[-1]),
                tuple(samples.part("excitations")) if samples.excitations else (),
            ),
        )

    def select(self, outputs: Places, inputs: Places, frequencies: Places) -> LinearEstimate | None:
        """Follow a selection of the response; None where the weights need the outputs left out."""
        rows, columns, points = self.places
        if not self.weights.tells_parts and len(set(outputs.tolist())) < len(rows):
            return None
        return replace(
            self,
            output_records=tuple(record[outputs] for record in self.output_records),
            places=(rows[outputs], columns[inputs], points[frequencies]),
        )

    def apply(self, changes: Sequence[Real]) -> Complex:
        """Change of the response for changes of its outputs, to first order in a composite.

        Parameters
        ----------
        changes : sequence of ndarray, each shape (n_out, n_samples)
            One for each record, for the outputs of the response in their order and unit.

        Returns
        -------
        ndarray of complex, shape (n_out, n_in, n_f)

        Raises
        ------
        ShapeError
            Changes do not fit the records.
        """
        needed = [record.shape for record in self.output_records]
        found = [np.shape(change) for change in changes]
        if found != needed:
            raise ShapeError("changes do not fit the records", found=found, needed=needed)
        return self.functional()(changes)

    def functional(self) -> Functional:
        """The weights made ready to be applied again and again: no shape is checked."""
        return self.weights.functional(*self.places)

    def pilots_of_outputs(self) -> list[Pilot] | None:
        """Pilot models of the response's outputs; None where they cannot be had.

        Records with too few bins, or weights by a noise model, whose errors pilots do not know.
        """
        if not self.weights.tells_parts:
            return None
        found = [self.pilots.found[row] for row in self.places[0]]
        known = [each for each in found if each is not None]
        return known if len(known) == len(found) else None

    def of_pilot(self, row: int) -> Complex:
        """The estimate of slopes of an output's pilot, shape (n_coefficients, n_in, n_f).

        By all inputs that the estimate was conditioned on, kept for further pairs of the output.
        """
        place, points = int(self.places[0][row]), self.places[2]
        kept, key = self.pilots.seen, (place, points.tobytes())
        pilot = self.pilots.found[place]
        if key not in kept and pilot is not None:
            rows = np.full(len(pilot.covariance), place)
            apply = self.weights.functional(rows, np.arange(len(self.inputs)), points)
            changes = []
            for record, slopes in enumerate(pilot.slopes):
                # Zeros where a coefficient does not act: these take no memory, and no time below.
                changes.append(np.zeros((len(rows), slopes.shape[1])))
                changes[-1][pilot.acting(record)] = slopes
            kept[key] = apply(changes)
        return kept[key]

    def local_spread(self) -> Real | None:
        """Of the response, what bins beside its frequencies tell alone, (n_in, n_f) or None."""
        kept = self.pilots.told
        if not kept:
            kept.append(self.weights.local_spread(self.input_records))
        found = kept[0]
        return None if found is None else np.asarray(found[np.ix_(*self.places[1:])])

    def errors_of(
        self, residuals: Sequence[Real], resonant_rad_s: float = 0.0
    ) -> CovarianceSource | None:
        """Errors of the response with the noise that a model's residuals show.

        Parameters
        ----------
        residuals : sequence of ndarray, each shape (n_out, n_samples)
            Measured less modelled outputs of each record.
        resonant_rad_s : float
            Up to which frequency noise may be narrow: see `noise_of_residuals`.

        Returns
        -------
        CovarianceSource or None
            None where the estimate's own noise is as good.
        """
        found = self.weights.errors_of(residuals, self.places[0], resonant_rad_s)
        return None if found is None else ErrorSelection(found, *self.places)

    def errors_with(self, noise: NoiseSpectrum) -> CovarianceSource:
        """Errors of the response with another noise of its outputs."""
        return ErrorSelection(self.weights.errors_with(noise, self.places[0]), *self.places)
