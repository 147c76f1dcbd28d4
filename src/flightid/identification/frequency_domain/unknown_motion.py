"""Motion of unknown initial states and trims beside a record, fitted to what a model leaves."""

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
    """Least squares for unknown motion, with each output's weight.

    Attributes
    ----------
    gain : ndarray, shape (n_unknowns, n_outputs, k)
        From parts inside each output's basis to coefficients.
    normal : ndarray, shape (n_unknowns, n_unknowns)
        Inverse of the normal equations.
    scale : ndarray, shape (n_outputs,)
        By which outputs were divided.
    alone : ndarray, shape (n_outputs, n_unknowns)
        Coefficients of a fit of each output by itself.
    left_alone : ndarray, shape (n_outputs, n)
        What those leave: `scale` is its deviation.
    """

    gain: Array
    normal: Array
    scale: Array
    alone: Array
    left_alone: Array


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
        (n_outputs, n), in such a fit of their own.
        """
        inside = np.einsum("ynk,yn->yk", self.bases, rest, optimize=True)
        alone = np.einsum("yuk,yk->yu", self.apart, inside)
        left = rest - np.einsum("ynk,yku,yu->yn", self.bases, self.triangles, alone, optimize=True)
        scale = np.maximum(np.std(left, axis=1), TINY)
        stacked = (self.triangles / scale[:, None, None]).reshape(-1, self.triangles.shape[2])
        inverse = np.linalg.pinv(stacked, rcond=_RANK)
        gain = inverse.reshape(-1, *self.triangles.shape[:2]) / scale[:, None]
        return MotionFitter(gain, inverse @ inverse.T, scale, alone, left)

    def coefficients(self, fitter: MotionFitter, rest: Array) -> Array:
        """Of the motions that fit best, shape (…, n_unknowns), for rests of shape (…, n_out, n)."""
        inside = np.einsum("ynk,...yn->...yk", self.bases, rest, optimize=True)
        return np.asarray(np.einsum("uyk,...yk->...u", fitter.gain, inside, optimize=True))

    def less(self, fitter: MotionFitter, rest: Array) -> Array:
        """Take these motions out."""
        moved = np.tensordot(self.coefficients(fitter, rest), self.motions, axes=1)
        return np.asarray(rest - moved)


@dataclass(frozen=True)
class FollowedRun:
    """One record with a model beside it.

    Attributes
    ----------
    rest : ndarray, shape (n_out, n)
        Measured less modelled.
    driven : ndarray, shape (n_fitted, n)
        Modelled, without unknown motion.
    fitter : MotionFitter
    start : ndarray, shape (n_unknowns,)
        Initial states and trims.
    """

    rest: Array
    driven: Array
    fitter: MotionFitter
    start: Array

    def weighed(self, kept: Places) -> Array:
        """What is left of the fitted outputs, by the squares of their weights."""
        return np.asarray(self.rest[kept] / self.fitter.scale[:, None] ** 2)

    def pulls(self, kept: Places, unknown: MotionBasis) -> Array:
        """What each output's weight asks of the unknowns, shape (n_unknowns, n_fitted)."""
        return np.asarray(np.einsum("uyn,yn->uy", unknown.motions, self.rest[kept], optimize=True))

    def reweighing(self, pulls: Array, pushed: Array, answered: Array, lengths: Array) -> Array:
        """What the unknowns are asked for by weights that move with a model, shape (n_unknowns,).

        Weights are what a fit of each output alone leaves, so they answer to the model as well;
        its own coefficients, where it stands, move what it leaves by nothing.

        Parameters
        ----------
        pulls : ndarray
        pushed : ndarray, shape (n_fitted, n)
            By how much the model moves what is driven.
        answered : ndarray, shape (n_fitted, n_unknowns)
            What is left alone times by how much it moves the unknown motions.
        lengths : ndarray, shape (n_unknowns,)
        """
        fitter = self.fitter
        along = np.einsum("yn,yn->y", fitter.left_alone, pushed)
        along += np.einsum("yu,yu->y", fitter.alone / lengths, answered)
        return np.asarray(pulls @ (2.0 * along / (pushed.shape[1] * fitter.scale**4)))
