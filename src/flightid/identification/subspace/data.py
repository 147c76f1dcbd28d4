"""Records as block Hankel matrices, and their one triangular factor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.identification.subspace.hankel_products import hankel_products
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.sampled.channels import SampledChannels, gather_channels
from flightid.record import Record
from flightid.uncertainty.triangle import triangle_of_parts

Array = NDArray[np.float64]
USUAL_HORIZON = 15
BLOCK = 20_000
"""Columns that go into the triangular factor at a time."""
LONG = 50
"""Samples for each block row from which products of rows are made of those of one lag."""
ROUNDING = 60.0
"""Minus the logarithm of a share of the outputs' power that is rounding."""
POOR = 1e-9
"""Ratio of singular values of the inputs' blocks below which they do not excite."""


@dataclass(frozen=True, eq=False)
class SubspaceData:
    """Outputs and inputs of each record, the outputs divided by their sizes.

    Attributes
    ----------
    outputs, inputs : tuple of ndarray, shapes (p, n_samples) and (m, n_samples)
        For each record.
    scales : ndarray, shape (p,)
        Root mean square of each output, so that no unit outweighs another.
    channels : SampledChannels
        The same end to end, with units and offsets.
    """

    outputs: tuple[Array, ...]
    inputs: tuple[Array, ...]
    scales: Array
    channels: SampledChannels

    @cached_property
    def signals(self) -> tuple[Array, ...]:
        """Inputs, then outputs of each record, (m + p, n_samples)."""
        return tuple(np.vstack([u, y]) for y, u in zip(self.outputs, self.inputs, strict=True))

    @property
    def n_outputs(self) -> int:
        """Number of outputs p."""
        return self.scales.size

    @property
    def n_inputs(self) -> int:
        """Number of inputs m."""
        return int(self.inputs[0].shape[0])

    def split(self, share: float) -> tuple[SubspaceData, SubspaceData]:
        """The first share of each record, and the rest."""
        cuts = [round(share * y.shape[1]) for y in self.outputs]
        sides = (slice(None, cut) for cut in cuts), (slice(cut, None) for cut in cuts)
        made = []
        for spans in sides:
            kept = list(spans)
            y = tuple(row[:, k] for row, k in zip(self.outputs, kept, strict=True))
            u = tuple(row[:, k] for row, k in zip(self.inputs, kept, strict=True))
            made.append(replace(self, outputs=y, inputs=u))
        return made[0], made[1]

    def horizon(self, structure: SubspaceStructure) -> int:
        """Block rows: as asked, or the usual number, fewer where records are short."""
        if structure.horizon is not None:
            return structure.horizon
        least = structure.least_horizon
        for rows in range(max(USUAL_HORIZON, least), least, -1):
            columns = sum(max(0, y.shape[1] - 2 * rows + 1) for y in self.outputs)
            if columns >= 4 * rows * (self.n_outputs + self.n_inputs):
                return rows
        return least

    def lagged(self, horizon: int) -> tuple[Array, Array, Array]:
        """Past inputs and outputs (oldest first), outputs and inputs now, over all records."""
        past, now, driven = [], [], []
        for y, u in zip(self.outputs, self.inputs, strict=True):
            if y.shape[1] <= horizon:
                continue
            past.append(self._about(_hankel(np.vstack([u, y]), horizon)[:, :-1]))
            now.append(self._about(y[:, horizon:]))
            driven.append(self._about(u[:, horizon:]))
        if not past:
            return tuple(np.zeros((0, 0)) for _ in range(3))  # type: ignore[return-value]
        return np.hstack(past), np.hstack(now), np.hstack(driven)

    def hankel_factor(self, blocks: int, rows: NDArray[np.int64]) -> Array:
        """Triangular factor R of the block Hankel matrices of all records, made bit by bit.

        Parameters
        ----------
        blocks : int
        rows : ndarray of int
            Rows in the order of the factor, of u then y at one time, time by time. What is
            constant in a record is taken out.
        """
        return triangle_of_parts(
            lambda: self._hankel_parts(blocks, rows), self._hankel_products(blocks, rows)
        )

    def _hankel_products(self, blocks: int, rows: NDArray[np.int64]) -> Array | None:
        """Products of columns of the factored matrix; None where they are to be made of these."""
        levels, found = self.channels.levels, np.zeros(2 * (blocks * len(self.signals[0]),))
        for joint in self.signals:
            if joint.shape[1] < LONG * blocks:
                return None
            made = hankel_products(joint, blocks, levels=levels)
            if made is None:
                return None
            found += made
        return found[np.ix_(rows, rows)]

    def _hankel_parts(self, blocks: int, rows: NDArray[np.int64]) -> Iterator[Array]:
        """Columns of the Hankel matrices some at a time, as rows; of short records none."""
        yield np.zeros((0, len(rows)))
        for joint in self.signals:
            columns = joint.shape[1] - blocks + 1
            means = np.zeros((blocks * len(joint), 1))
            if self.channels.levels and columns > 0:
                spans = [joint[:, first : first + columns] for first in range(blocks)]
                means = np.concatenate([span.mean(axis=1, keepdims=True) for span in spans])
            for first in range(0, columns, BLOCK):
                part = joint[:, first : min(first + BLOCK, columns) + blocks - 1]
                yield (_hankel(part, blocks) - means)[rows].T

    def _about(self, rows: Array) -> Array:
        return rows - rows.mean(axis=1, keepdims=True) if self.channels.levels else rows

    def about(self, levels: Sequence[Array]) -> SubspaceData:
        """The same about these levels of the outputs, one row for each record.

        A level outside what a record shows, as beside a pole at one, stays where the mean is.
        """
        names = list(self.channels.units)[: self.n_outputs]
        outputs, offsets, joint = [], [], self.channels.output.copy()
        others = self.channels.inputs.copy()
        for y, level, before, span in zip(
            self.outputs, levels, self.channels.offsets, self.channels.spans, strict=True
        ):
            moved = np.where(np.abs(level) <= np.ptp(y, axis=1), level, 0.0)
            outputs.append(y - moved[:, None])
            shift = moved * self.scales
            joint[span] -= shift[0]
            others[: self.n_outputs - 1, span] -= shift[1:, None]
            moves = dict(zip(names, shift.tolist(), strict=True))
            offsets.append({name: at + moves.get(name, 0.0) for name, at in before.items()})
        channels = replace(self.channels, output=joint, inputs=others, offsets=tuple(offsets))
        return replace(self, outputs=tuple(outputs), channels=channels)

    def neighbours(self, horizon: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Columns of `lagged` with a successor in the same record, and the successors."""
        counts = [y.shape[1] - horizon for y in self.outputs if y.shape[1] > horizon]
        ends = np.cumsum(counts)
        before = np.setdiff1d(np.arange(ends[-1]), ends - 1)
        return before, before + 1


def gather(structure: SubspaceStructure, records: Sequence[Record]) -> SubspaceData:
    """Channels of the records after their checks."""
    p = len(structure.outputs)
    others = (*structure.outputs[1:], *structure.inputs)
    channels = gather_channels(records, structure.outputs[0], others, structure.offsets)
    channels.require_change()
    y = np.vstack([channels.output[None], channels.inputs[: p - 1]])
    u = channels.inputs[p - 1 :]
    scales = np.sqrt(np.mean(y**2, axis=1))
    spans = channels.spans
    return SubspaceData(
        tuple(y[:, span] / scales[:, None] for span in spans),
        tuple(u[:, span] for span in spans),
        scales,
        channels,
    )


def acts_at_once(data: SubspaceData, horizon: int) -> bool:
    """Whether the inputs of the same sample explain more of the outputs than as many numbers cost.

    What the past of outputs and inputs foretells is taken out first, so no order is assumed.

    Reference: Schwarz (1978), Estimating the dimension of a model, *Annals of Statistics* 6.
    """
    p, m = data.n_outputs, data.n_inputs
    first, samples = horizon * (m + p), sum(max(y.shape[1] - horizon, 0) for y in data.outputs)
    if samples <= first + m + p:
        return False
    triangle = data.hankel_factor(horizon + 1, np.arange(first + m + p))
    late, prompt = triangle[first:, first + m :], triangle[first + m :, first + m :]
    levels = [np.linalg.slogdet(each.T @ each / samples)[1] for each in (late, prompt)]
    if not np.isfinite(levels[0]) or levels[0] < -ROUNDING * p:
        return False
    return bool(samples * (levels[0] - levels[1]) > p * m * np.log(samples))


def _hankel(rows: Array, blocks: int) -> Array:
    """Block Hankel matrix, shape (blocks · channels, n_samples - blocks + 1), time by time."""
    windows = np.lib.stride_tricks.sliding_window_view(rows, blocks, axis=1)
    return np.moveaxis(windows, 2, 0).reshape(blocks * rows.shape[0], -1)


@dataclass(frozen=True, eq=False)
class RowSpaceFactor:
    """Lower triangular factor of [U_f; U_p; Y_p; Y_f]: every row space without its length.

    Attributes
    ----------
    factor : ndarray
        L of the Hankel matrix L Qᵀ.
    horizon, n_inputs, n_outputs, n_columns : int
    """

    factor: Array
    horizon: int
    n_inputs: int
    n_outputs: int
    n_columns: int

    @property
    def _ends(self) -> tuple[int, int, int]:
        m, p = self.horizon * self.n_inputs, self.horizon * self.n_outputs
        return m, 2 * m + p, 2 * m + 2 * p

    @property
    def future_on_past(self) -> Array:
        """Part of the future outputs in the past, future inputs taken out."""
        first, second, _ = self._ends
        return self.factor[second:, first:second]

    @property
    def future_noise(self) -> Array:
        """Part of the future outputs in neither."""
        return self.factor[self._ends[1] :, self._ends[1] :]

    def oblique(self) -> Array:
        """Future outputs on the past along the future inputs."""
        first, second, _ = self._ends
        past = self.factor[first:second, :second]
        corner = self.factor[first:second, first:second]
        return np.asarray(self.future_on_past @ np.linalg.pinv(corner, rcond=POOR) @ past)

    def residual_covariance(self, gamma: Array, a: Array, c: Array) -> tuple[Array, Array, Array]:
        """Covariances Q, S, R of what A and C leave of the next states and of the outputs.

        Reference: Van Overschee & De Moor (1996), section 4.4.3.
        """
        s, m, p = self.horizon, self.n_inputs, self.n_outputs
        first, second, _ = self._ends
        u_future, u_past = self.factor[:first], self.factor[first : 2 * first]
        y_past, y_future = self.factor[2 * first : second], self.factor[second:]
        here = self._states(gamma, y_future, u_future, np.vstack([u_past, y_past]))
        longer = np.vstack([u_past, u_future[:m], y_past, y_future[:p]])
        ahead = self._states(gamma[: (s - 1) * p], y_future[p:], u_future[m:], longer)
        left = np.vstack([ahead - a @ here, y_future[:p] - c @ here])
        weights = np.linalg.lstsq(u_future.T, left.T, rcond=None)[0]
        left = left - weights.T @ u_future
        n = a.shape[0]
        joint = left @ left.T / self.n_columns
        return joint[:n, :n], joint[:n, n:], joint[n:, n:]

    @staticmethod
    def _states(gamma: Array, future: Array, inputs: Array, past: Array) -> Array:
        rows = np.vstack([past, inputs])
        weights = np.linalg.lstsq(rows.T, future.T, rcond=POOR)[0][: past.shape[0]]
        return np.asarray(np.linalg.lstsq(gamma, weights.T @ past, rcond=None)[0])


def require_columns(columns: int, needed: int, horizon: int) -> None:
    """Refuse records that are too short for the horizon."""
    if columns < needed:
        raise DataError(
            "the records are too short for the horizon",
            found=f"{columns} columns with {horizon} block rows of past and future",
            needed=f"at least {needed}",
            action="give longer records, a shorter horizon or a smaller maximum_order",
        )


def compress(data: SubspaceData, horizon: int) -> RowSpaceFactor:
    """One QR of the Hankel matrices of all records, made block by block.

    Raises
    ------
    DataError
        Too few samples, or inputs that do not excite 2·horizon lags.
    """
    p, m = data.n_outputs, data.n_inputs
    needed = 2 * horizon * (p + m)
    columns = sum(max(0, y.shape[1] - 2 * horizon + 1) for y in data.outputs)
    require_columns(columns, needed, horizon)
    places = np.arange(2 * horizon * (m + p)).reshape(2 * horizon, m + p)
    ordered = places[horizon:, :m], places[:horizon, :m], places[:, m:]
    triangle = data.hankel_factor(2 * horizon, np.concatenate([each.ravel() for each in ordered]))
    lags = _independent_lags(triangle[: 2 * horizon * m, : 2 * horizon * m])
    if lags < 2 * horizon * m:
        raise DataError(
            "the inputs are not persistently exciting",
            found=f"{lags} independent input lags",
            needed=f"{2 * horizon * m} for a horizon of {horizon}",
            action=_less_excited(data, horizon),
        )
    return RowSpaceFactor(triangle.T, horizon, m, p, columns)


def _independent_lags(triangle: Array) -> int:
    excited = np.linalg.svd(triangle, compute_uv=False)
    return int(np.sum(excited >= POOR * excited[0]))


def _less_excited(data: SubspaceData, horizon: int) -> str:
    """What to do: lags of a smooth input grow alike, so a horizon is tried before it is named."""
    p, m = data.n_outputs, data.n_inputs
    for rows in range(horizon - 1, 1, -1):
        now = [first + i for first in range(0, 2 * rows * (m + p), m + p) for i in range(m)]
        if _independent_lags(data.hankel_factor(2 * rows, np.array(now))) == len(now):
            most = p * (rows - 1)
            return f"excite more frequencies, or take horizon={rows}, maximum_order={most}"
    return "excite more frequencies, or fit an output-error model (kind 'oe')"
