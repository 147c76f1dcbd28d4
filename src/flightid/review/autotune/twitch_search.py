"""Maximum likelihood of short stretches in a loop: the vehicle and what disturbs it, in turns.

Errors of the free run are whitened by the triangular root of their covariance, which looks back
alone: what a loop feeds back is known to a prediction from the past, so it does not bend estimates
as it bends a free run's. Steps of Gauss and Newton move the vehicle, of Fisher's scores the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.output_error.distinct import run_with_slopes
from flightid.identification.records.setup import RecordSet
from flightid.models.transfer.model import TransferFunctionModel
from flightid.review.autotune.twitch_noise import SOURCES, NoiseShape, TwitchNoise, partial_of

Array = NDArray[np.float64]
TURNS, ENOUGH = 60, 1e-3
"""Most turns, and the gain in log-likelihood below which they end."""
SHARES = (1.0, 0.5, 0.2, 0.05, 0.01)
LARGEST_STEP = 1.0
"""Of a logarithm or a partial correlation in one turn."""
FLOOR, CEILING = 1e-5, 1e3
"""Of sizes, over the deviation of the errors that the search begins with."""
FIRST_SHARES = (0.3, 0.03, 0.1, 0.1, 0.3, 0.3)
"""Sizes where the search begins, over that deviation."""
FOLLOWED = 10
"""Turns in which the shape of the noise follows the damping; then it stands, so that turns end."""
RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class TwitchEnd:
    """Where the search ended.

    Attributes
    ----------
    model : TransferFunctionModel
    noise : TwitchNoise
    level : ndarray, shape (2,)
        What the output that holds the vehicle still is off, at the middle, and half of its drift.
    white : ndarray, shape (n_stretches, count)
        Innovations of unit variance; zero behind the end of a stretch.
    slopes : ndarray, shape (n_free, n_stretches, count)
        Derivatives of the model's outputs, whitened, less what the level takes of them.
    deviations : ndarray, shape (count,)
        Of the innovations, rad/s.
    cost : float
        Negative logarithm of the likelihood, without its constant.
    turns : int
    is_converged : bool
    """

    model: TransferFunctionModel
    noise: TwitchNoise
    level: Array
    white: Array
    slopes: Array
    deviations: Array
    cost: float
    turns: int
    is_converged: bool

    @property
    def innovations(self) -> Array:
        """Errors of predictions one sample ahead, rad/s."""
        return self.white * self.deviations


class TwitchSearch:
    """Stretches of one axis, which hold inputs from before their first measured rate on.

    Parameters
    ----------
    prepared : RecordSet
    leads : sequence of int
        Samples of each record before its first measured rate.
    gyro_filter_hz : float
    stepped : RecordSet
        One record, in which the input steps to one at its second sample, no shorter than any other.
    begun : sequence of int or None
        Sample of each record at which its inputs stop to be what holds the vehicle still by
        supposition; None where the level is not asked for.
    """

    def __init__(
        self,
        prepared: RecordSet,
        leads: Sequence[int],
        gyro_filter_hz: float,
        stepped: RecordSet,
        begun: Sequence[int | None],
    ) -> None:
        self.prepared, self.leads, self.gyro_filter_hz = prepared, leads, gyro_filter_hz
        self.stepped, self.begun = stepped, begun
        drift = np.linspace(-1.0, 1.0, len(leads)) if len(leads) > 1 else np.zeros(1)
        asked = np.array([each is not None for each in begun])
        self.weights = np.where(asked, np.stack([np.ones(len(leads)), drift]), 0.0)
        measured = [
            outputs[0, lead:] for (_, outputs, _), lead in zip(prepared.arrays, leads, strict=True)
        ]
        self.lengths = np.array([len(each) for each in measured])
        self.count = int(self.lengths.max())
        self.measured = np.array([self._padded(each) for each in measured])
        self.inside = np.arange(self.count) < self.lengths[:, None]
        self.sample_time_s = float(np.median([dt for _, _, dt in prepared.arrays]))

    def _padded(self, row: Array) -> Array:
        return np.pad(row, (0, self.count - len(row)))

    def runs(self, model: TransferFunctionModel, level: Array) -> tuple[Array, Array]:
        """Errors (n_stretches, count) of free runs from rest, and slopes of the runs.

        Slopes by the two numbers of the level come last.
        """
        errors, slopes = [], []
        for place, (own, lead) in enumerate(zip(self.prepared.own, self.leads, strict=True)):
            run, slope = run_with_slopes(model, self.prepared, None, place, own)
            errors.append(self.measured[place] - self._padded(run[0, lead:]))
            slopes.append([self._padded(each) for each in slope[0, lead:].T])
        moved = np.array(slopes).reshape(len(errors), -1, self.count).swapaxes(0, 1)
        steps, by_step = self._steps(model)
        off = (level @ self.weights)[:, None]
        return (
            (np.array(errors) - off * steps) * self.inside,
            np.concatenate([moved + off * by_step, self.weights[:, :, None] * steps]),
        )

    def _steps(self, model: TransferFunctionModel) -> tuple[Array, Array]:
        """What an input that is off by one from where it is measured does, and its slopes."""
        run, slope = run_with_slopes(model, self.stepped, None, 0, self.stepped.own[0])
        rows = np.concatenate([run, slope[0].T])
        taken = [
            rows[:, 1 + lead - (begun or 0) :][:, : self.count]
            for lead, begun in zip(self.leads, self.begun, strict=True)
        ]
        every = np.stack(taken, axis=1) * self.inside
        return every[0], every[1:]

    def whitened(self, root: Array, rows: Array) -> Array:
        """Rows without their covariance, by what lies before each sample alone."""
        flat = rows.reshape(-1, self.count).T
        found = scipy.linalg.solve_triangular(root, flat, lower=True, check_finite=False)
        return np.asarray(found.T.reshape(rows.shape) * self.inside)

    def cost(self, root: Array, white: Array) -> float:
        """Negative log-likelihood without its constant."""
        level = np.cumsum(np.log(np.diag(root)))[self.lengths - 1]
        return float(level.sum() + 0.5 * np.sum(white**2))

    def search(
        self, model: TransferFunctionModel, *, ticks: int, order: int, start: TwitchEnd | None
    ) -> TwitchEnd:
        """The likeliest vehicle and noise whose gyro's colour has that order.

        `start` is an end without colour, else the noise begins at shares of the errors.
        """
        level = np.zeros(2) if start is None else start.level
        errors, slopes = self.runs(model, level)
        deviation = float(np.sqrt(np.mean(errors[self.inside] ** 2)))
        limits = np.log(deviation * FLOOR), np.log(deviation * CEILING)
        damping = float(model.parameters["L"].value or 0.0)
        shape = NoiseShape(self.count, self.sample_time_s, self.gyro_filter_hz, damping, ticks)
        sizes = np.log(deviation * np.array(FIRST_SHARES)) if start is None else start.noise.sizes
        # Innovations of noise that was taken for white have the colour that it had.
        known = np.zeros(order) if start is None else partial_of(self._lags(start.white, order))
        noise = TwitchNoise(shape, sizes, known)
        root = _root(noise)
        cost, turn, settled = np.inf, 0, False
        for turn in range(1, TURNS + 1):
            before = cost
            model, level, errors, slopes = self._vehicle(model, level, root, errors, slopes)
            if turn <= FOLLOWED:
                damping = float(model.parameters["L"].value or 0.0)
                noise = replace(noise, shape=replace(noise.shape, damping=damping))
            noise, root, cost = self._disturbance(noise, errors, limits)
            settled = turn > FOLLOWED // 2 and abs(before - cost) < ENOUGH
            if settled:
                break
        white = self.whitened(root, errors)
        told = _without_level(self.whitened(root, slopes))
        return TwitchEnd(model, noise, level, white, told, np.diag(root), cost, turn, settled)

    def _lags(self, white: Array, order: int) -> Array:
        """Autocovariances of innovations."""
        return np.array(
            [np.sum(white[:, lag:] * white[:, : self.count - lag]) for lag in range(order + 1)]
        )

    def _vehicle(
        self,
        model: TransferFunctionModel,
        level: Array,
        root: Array,
        errors: Array,
        slopes: Array,
    ) -> tuple[TransferFunctionModel, Array, Array, Array]:
        """One step of Gauss and Newton, inside the bounds."""
        free = model.parameters.free
        now = np.array([float(p.value or 0.0) for p in free])
        low, high = (np.array([getattr(p, end) for p in free]) for end in ("minimum", "maximum"))
        white = self.whitened(root, errors)
        columns = self.whitened(root, slopes).reshape(len(slopes), -1).T
        size = np.linalg.norm(columns, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        step = np.linalg.lstsq(columns / size, white.ravel(), rcond=RIDGE)[0] / size
        before, split = float(np.sum(white**2)), len(free)
        for share in SHARES:
            values = np.clip(now + share * step[:split], low, high)
            off = level + share * step[split:]
            names = (p.name for p in free)
            tried = model.with_values(dict(zip(names, map(float, values), strict=True)))
            fresh, slope = self.runs(tried, off)
            if float(np.sum(self.whitened(root, fresh) ** 2)) < before:
                return tried, off, fresh, slope
        return model, level, errors, slopes

    def _disturbance(
        self, noise: TwitchNoise, errors: Array, limits: tuple[float, float]
    ) -> tuple[TwitchNoise, Array, float]:
        """One step of Fisher's scores."""
        root = _root(noise)
        white = self.whitened(root, errors)
        cost = self.cost(root, white)
        score, information = self._scores(root, white, noise.slopes())
        scale = np.sqrt(np.diag(information)) + np.finfo(float).tiny
        unit = information / np.outer(scale, scale) + RIDGE * np.eye(len(scale))
        step = np.linalg.solve(unit, score / scale) / scale
        # Each by itself: a size that goes to nothing has no bottom, and would shorten all others.
        step = np.clip(step, -LARGEST_STEP, LARGEST_STEP)
        for share in SHARES:
            numbers = noise.numbers - share * step
            numbers[: len(SOURCES)] = np.clip(numbers[: len(SOURCES)], *limits)
            tried = noise.at(numbers)
            try:
                fresh = _root(tried)
            except np.linalg.LinAlgError:
                continue
            found = self.cost(fresh, self.whitened(fresh, errors))
            if found < cost:
                return tried, fresh, found
        return noise, root, cost

    def _scores(self, root: Array, white: Array, slopes: Sequence[Array]) -> tuple[Array, Array]:
        """Slopes of the cost by the noise's numbers, and Fisher's information on them.

        That of a stretch is of the leading block of what the longest has.
        """
        turned = []
        for slope in slopes:
            half = scipy.linalg.solve_triangular(root, slope, lower=True, check_finite=False)
            turned.append(
                scipy.linalg.solve_triangular(root, half.T, lower=True, check_finite=False)
            )
        ends = self.lengths - 1
        score = [
            0.5 * float(np.cumsum(np.diag(t))[ends].sum() - np.sum((white @ t) * white))
            for t in turned
        ]
        information = np.zeros((len(turned), len(turned)))
        for i, one in enumerate(turned):
            for j, other in enumerate(turned[: i + 1]):
                both = one * other
                # Row by row what each sample adds to the leading block.
                added = 2.0 * np.tril(both, -1).sum(axis=1) + np.diag(both)
                information[i, j] = information[j, i] = 0.5 * np.cumsum(added)[ends].sum()
        return np.array(score), information


def _root(noise: TwitchNoise) -> Array:
    covariance = noise.covariance()
    return np.asarray(scipy.linalg.cholesky(covariance, lower=True, check_finite=False))


def _without_level(slopes: Array) -> Array:
    """Slopes by what the vehicle has, less what the two of the level take of them."""
    rows = slopes.reshape(len(slopes), -1)
    own, level = rows[:-2], rows[-2:]
    shares = np.linalg.lstsq(level.T, own.T, rcond=RIDGE)[0]
    return np.asarray((own - shares.T @ level).reshape(len(own), *slopes.shape[1:]))
