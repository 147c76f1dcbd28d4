"""Parts of the records behind a response: what each adds to a fit of it.

A response is linear in its outputs, so what the model leaves of one half of one record passes
through the weights of the estimate, and through the fit, by itself. At the optimum these parts add
up to nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.frequency_domain.error_model import ErrorModel
from flightid.identification.frequency_domain.estimator_bias import Correction
from flightid.identification.frequency_domain.longer_windows import slowest_mode
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.models import GreyBoxModel
from flightid.responses.windows.defaults import WINDOWS_IN_RECORDS
from flightid.uncertainty.agreement import AgreementTest, compare_parts
from flightid.uncertainty.parts import RecordParts

Array = NDArray[np.float64]
FAIR = 0.4
"""Least share of a part in the median point, over that of equal parts."""
ROUNDED = 0.95
"""Windows are whole hops long: of the room that they are given, what they may take too much."""
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class PartComparison:
    """What is needed to compare the parts of a fit to a response.

    Attributes
    ----------
    correction : Correction
    fitted : TransferFunctionModel or StateSpaceModel
    selected : sequence of SelectedResponse
    errors : ErrorModel
    slopes : ndarray, shape (n_points, n_free)
        Derivatives of what the estimator makes of the model, run after run.
    """

    correction: Correction
    fitted: GreyBoxModel
    selected: Sequence[SelectedResponse]
    errors: ErrorModel
    slopes: Array

    def compare(
        self, gain: Array, triangle: Array, inner: NDArray[np.bool_], added: Array
    ) -> AgreementTest:
        """Covariance of the estimates, halves and records compared.

        Parameters
        ----------
        gain : ndarray, shape (n, n_points)
            How the estimates move with the points, but for the sign.
        triangle : ndarray, shape (n, n)
            Upper root of the information that the fit weighs the points by.
        inner : ndarray of bool, shape (n_free,)
            Free parameters that are not at a bound.
        added : ndarray, shape (n, n)
            Covariance of the estimates beyond that of the points' errors.

        Assumes
        -------
        Noise as strong in all parts; at each frequency a part counts by its share of the power,
        and so does its noise. That fails where parts hold other frequencies, as the halves of one
        sweep or sweeps of different inputs do, or halves that a light mode rings across: such parts
        are not compared.
        """
        left, modelled = self.correction.halves(self.fitted, self._places)
        whole = self._points(modelled.sum(axis=(0, 1)))
        slopes = self.slopes[:, inner]
        n, count = len(gain), left.shape[0]
        # Moves of parameters have units of their own; what solves for them is one measure of all.
        root = scipy.linalg.solve_triangular(triangle, np.eye(n))
        towards = triangle.T @ triangle
        scores, information, weighed, shares = [], [], [], []
        for kept, made in zip(
            left.reshape(-1, *left.shape[2:]), modelled.reshape(-1, *left.shape[2:]), strict=True
        ):
            share = _share(self._points(made), whole)
            shares.append(share)
            scores.append(-gain @ _stacked(self._points(kept)))
            information.append(-gain @ (share[:, None] * slopes))
            weighed.append(gain * np.sqrt(share))
        parts = np.array(shares)
        compared = partial(
            compare_parts,
            by_halves=self._each_input_fair(parts) and not self._rings_across,
            by_records=_fair(parts[0::2] + parts[1::2]),
        )
        total = np.sum(information, axis=0)
        # Nobody asks for the noise of parts that are not compared.
        rows = [gain, *weighed] if any(compared.keywords.values()) else [gain]
        known, freedom = self.errors.propagated(np.vstack(rows), n)
        known = known.reshape(len(rows), n, len(rows), n)
        flights = []
        for k in range(count):
            noise = np.zeros((2, n, 2, n))
            for half, place in enumerate(range(1, len(rows))[2 * k : 2 * k + 2]):
                noise[half, :, half] = towards @ known[place, :, place] @ towards
            both = slice(2 * k, 2 * k + 2)
            part = towards @ np.array(information[both]) @ np.linalg.inv(total)
            flights.append(RecordParts(np.array(scores[both]) @ towards, part, noise))
        return compared(flights, root @ root.T, known[0, :, 0] + added, freedom)

    def _each_input_fair(self, shares: Array) -> bool:
        """Whether every part makes a fair share of most points of each input.

        Over the points of all inputs, those swept in the other half stand in for each other.
        """
        inputs = [
            each.measured.input
            for run in self.errors.runs
            for _ in ("real", "imaginary")
            for each in self.selected[run.first : run.first + run.count]
            for _ in each.places
        ]
        return all(_fair(shares[:, np.array(inputs) == name]) for name in dict.fromkeys(inputs))

    @property
    def _rings_across(self) -> bool:
        """Whether a mode outlasts a half, in windows of which few lie within one."""
        data, linear = self.correction.data, self.correction.data.linear
        mode = slowest_mode(self.fitted, data)
        if mode is None or linear is None or not mode.outlasts:
            return False
        total_s = sum(u.shape[1] for u in linear.input_records) * linear.sample_time_s
        return bool(total_s < ROUNDED * WINDOWS_IN_RECORDS * mode.before_s)

    @property
    def _places(self) -> NDArray[np.intp]:
        return np.unique(np.concatenate([each.places for each in self.selected]))

    def _points(self, response: Complex) -> list[Complex]:
        """Fitted points of each run, from a response of all outputs and inputs at `_places`."""
        data = self.correction.data
        found = []
        for run in self.errors.runs:
            group = self.selected[run.first : run.first + run.count]
            rows = [
                response[
                    data.outputs.index(each.measured.output), data.inputs.index(each.measured.input)
                ][np.searchsorted(self._places, each.places)]
                for each in group
            ]
            found.append(np.concatenate(rows))
        return found


def _fair(shares: Array) -> bool:
    """Whether every part makes a fair share of most points."""
    return bool(np.median(shares, axis=1).min() >= FAIR / len(shares))


def _stacked(runs: Sequence[Complex]) -> Array:
    """All real parts of a run, then all imaginary ones, run after run."""
    return np.concatenate([side for run in runs for side in (run.real, run.imag)])


def _share(made: Sequence[Complex], whole: Sequence[Complex]) -> Array:
    """Share of each point that one part of the records makes, from 0 to 1."""
    found = []
    for one, every in zip(made, whole, strict=True):
        size = np.maximum(np.abs(every), np.finfo(float).tiny)
        share = np.clip((one * every.conj()).real / size**2, 0.0, 1.0)
        found += [share, share]
    return np.concatenate(found)
