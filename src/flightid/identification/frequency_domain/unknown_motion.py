"""Motion of unknown initial states and trims beside records, fitted to what a model leaves.

Records of one length have their motions in common: their products are worked out together.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
Places = NDArray[np.intp]
_RANK = 1e-9
STILL = 1e-12
"""Of a motion, the share about its mean up to which it stands still."""
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class MotionFitter:
    """Least squares for unknown motion, with each output's weight, by record.

    Attributes
    ----------
    gain : ndarray, shape (n_records, n_unknowns, n_outputs, k)
        From parts inside each output's basis to coefficients.
    normal : ndarray, shape (n_records, n_unknowns, n_unknowns)
        Inverse of the normal equations.
    scale : ndarray, shape (n_records, n_outputs)
        By which outputs were divided.
    alone : ndarray, shape (n_records, n_outputs, n_unknowns)
        Coefficients of a fit of each output by itself.
    left_alone : ndarray, shape (n_records, n_outputs, n)
        What those leave: `scale` is its deviation.
    """

    gain: Array
    normal: Array
    scale: Array
    alone: Array
    left_alone: Array

    def of(self, record: int) -> MotionFitter:
        """That of one record."""
        parts = (self.gain, self.normal, self.scale, self.alone, self.left_alone)
        return MotionFitter(*(each[record : record + 1] for each in parts))


@dataclass(frozen=True)
class MotionBasis:
    """Motion by unknown initial states and trims in each fitted output, ready for least squares.

    Attributes
    ----------
    motions : ndarray, shape (n_unknowns, n_outputs, n)
        Means removed, of length one.
    lengths : ndarray, shape (n_unknowns,)
        By which they were divided; infinite for a motion that stands still, which is then none.
    bases : ndarray, shape (n_outputs, n, k)
        Orthonormal in each output.
    triangles : ndarray, shape (n_outputs, k, n_unknowns)
        Each output's motion is its basis times its triangle.
    """

    motions: Array
    lengths: Array
    bases: Array
    triangles: Array

    @classmethod
    def of(cls, free: Array) -> MotionBasis:
        """Of motions, shape (n_unknowns, n_outputs, n)."""
        whole = np.linalg.norm(free, axis=(1, 2))
        free = free - free.mean(axis=2, keepdims=True)
        lengths = np.linalg.norm(free, axis=(1, 2))
        # An integrator stays where it began: rounding of its mean is no direction.
        lengths = np.where(lengths > np.maximum(STILL * whole, TINY), lengths, np.inf)
        free = free / lengths[:, None, None]
        bases, triangles = np.linalg.qr(free.transpose(1, 2, 0))
        return cls(free, lengths, bases, triangles)

    @cached_property
    def apart(self) -> Array:
        """From parts inside an output's basis to a fit of it alone, (n_outputs, n_unknowns, k)."""
        return np.asarray(np.linalg.pinv(self.triangles, rcond=_RANK))

    def fitter(self, rest: Array) -> MotionFitter:
        """Least squares of all outputs together.

        Fitted to each output by itself, so many unknowns would take what little a record says of
        its lowest frequencies with them. Outputs count by what they leave of `rest`, shape
        (n_records, n_outputs, n), in such a fit of their own.
        """
        inside = rest.transpose(1, 0, 2) @ self.bases
        alone = inside @ self.apart.transpose(0, 2, 1)
        met = alone @ self.triangles.transpose(0, 2, 1) @ self.bases.transpose(0, 2, 1)
        left = rest - met.transpose(1, 0, 2)
        scale = np.maximum(np.std(left, axis=2), TINY)
        n_outputs, k, n_unknowns = self.triangles.shape
        stacked = (self.triangles / scale[:, :, None, None]).reshape(-1, n_outputs * k, n_unknowns)
        inverse = np.linalg.pinv(stacked, rcond=_RANK)
        gain = inverse.reshape(-1, n_unknowns, n_outputs, k) / scale[:, None, :, None]
        normal = inverse @ inverse.transpose(0, 2, 1)
        return MotionFitter(gain, normal, scale, alone.transpose(1, 0, 2), left)

    def coefficients(self, fitter: MotionFitter, rest: Array) -> Array:
        """Of the motions that fit best, (n_records, n_each, n_unknowns).

        `rest` has shape (n_records, n_each, n_outputs, n): some of each record.
        """
        n_records, n_each, n_outputs, n = rest.shape
        rows = rest.transpose(2, 0, 1, 3).reshape(n_outputs, -1, n)
        inside = (rows @ self.bases).reshape(n_outputs, n_records, n_each, -1)
        flat = inside.transpose(1, 2, 0, 3).reshape(n_records, n_each, -1)
        gain = fitter.gain.reshape(*fitter.gain.shape[:2], -1)
        return np.asarray(flat @ gain.transpose(0, 2, 1))

    def moved(self, coefficients: Array) -> Array:
        """Motions by their coefficients, shape (..., n_unknowns), as (..., n_outputs, n)."""
        flat = self.motions.reshape(len(self.motions), -1)
        found = coefficients.reshape(-1, len(flat)) @ flat
        return found.reshape(*coefficients.shape[:-1], *self.motions.shape[1:])


@dataclass(frozen=True)
class FollowedRuns:
    """Records of one length with a model beside them.

    Attributes
    ----------
    places : tuple of int
        Of these records among all.
    rest : ndarray, shape (n_records, n_out, n)
        Measured less modelled.
    driven : ndarray, shape (n_records, n_fitted, n)
        Modelled, without unknown motion.
    fitter : MotionFitter
    start : ndarray, shape (n_records, n_unknowns)
        Initial states and trims.
    """

    places: tuple[int, ...]
    rest: Array
    driven: Array
    fitter: MotionFitter
    start: Array

    def weighed(self, kept: Places) -> Array:
        """What is left of the fitted outputs, by the squares of their weights."""
        return np.asarray(self.rest[:, kept] / self.fitter.scale[:, :, None] ** 2)

    def pulls(self, kept: Places, unknown: MotionBasis) -> Array:
        """What each output's weight asks of the unknowns, (n_records, n_unknowns, n_fitted)."""
        found = self.rest[:, kept].transpose(1, 0, 2) @ unknown.motions.transpose(1, 2, 0)
        return np.asarray(found.transpose(1, 2, 0))

    def reweighing(self, pulls: Array, pushed: Array, answered: Array, lengths: Array) -> Array:
        """What the unknowns are asked for by weights that move with a model, by record.

        Weights are what a fit of each output alone leaves, so they answer to the model as well;
        its own coefficients, where it stands, move what it leaves by nothing.

        Parameters
        ----------
        pulls : ndarray
        pushed : ndarray, shape (n_records, n_fitted, n)
            By how much the model moves what is driven.
        answered : ndarray, shape (n_records, n_fitted, n_unknowns)
            What is left alone times by how much it moves the unknown motions.
        lengths : ndarray, shape (n_unknowns,)

        Returns
        -------
        ndarray, shape (n_records, n_unknowns)
        """
        fitter = self.fitter
        along = np.vecdot(fitter.left_alone, pushed)
        along += np.vecdot(fitter.alone / lengths, answered)
        asked = 2.0 * along / (pushed.shape[2] * fitter.scale**4)
        return np.asarray((pulls @ asked[:, :, None])[:, :, 0])
