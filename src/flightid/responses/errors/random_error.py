"""How the errors of a response hang together: the protocol, and its selections."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.errors.noise_levels import LevelProducts, LevelVariances


class CovarianceSource(Protocol):
    """What can say how the errors of a response hang together."""

    def covariance(
        self,
        outputs: NDArray[np.intp],
        inputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """Covariance for each output, shape (n_out, 2 n_in n_f, 2 n_in n_f).

        Rows are real parts (inputs, and frequencies within an input) and then imaginary parts.
        """
        ...


class Points(NamedTuple):
    """Points of one output whose errors are wanted together: places of all inputs × frequencies."""

    output: int
    inputs: NDArray[np.intp]
    frequencies: NDArray[np.intp]


@runtime_checkable
class JointErrors(CovarianceSource, Protocol):
    """A source that knows how the errors of different outputs hang together."""

    def covariance(
        self,
        outputs: NDArray[np.intp],
        inputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """See `CovarianceSource`."""
        wanted = [Points(int(output), inputs, frequencies) for output in outputs]
        return np.stack(self.covariances(wanted))

    def covariances(self, wanted: Sequence[Points]) -> list[NDArray[np.float64]]:
        """One matrix for each output, shaped as by `CovarianceSource.covariance`."""
        ...

    def combined(
        self, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """Covariance of the sum of the gains times the errors of all points."""
        ...


@runtime_checkable
class LevelledErrors(Protocol):
    """A source that knows from how much noise its covariance was estimated."""

    def by_level(
        self, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]]
    ) -> list[LevelProducts | None]:
        """How each output's covariance hangs on levels of its noise; None where nobody knows.

        Parameters
        ----------
        wanted : sequence of Points
        gains : sequence of ndarray, each shape (n_rows, 2 n_in n_f)
            Columns ordered as the rows of `CovarianceSource.covariance`.
        """
        ...

    def combined_by_level(
        self, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]], count: int
    ) -> tuple[NDArray[np.float64], list[LevelVariances]]:
        """`JointErrors.combined`, and what levels of each output add to the first variances.

        Outputs whose levels nobody knows are left out of the latter.
        """
        ...


def by_level(
    errors: CovarianceSource, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]]
) -> list[LevelProducts | None]:
    """See `LevelledErrors`; None of a source that does not know."""
    if isinstance(errors, LevelledErrors):
        return errors.by_level(wanted, gains)
    return [None] * len(wanted)


def combined_by_level(
    errors: CovarianceSource,
    wanted: Sequence[Points],
    gains: Sequence[NDArray[np.float64]],
    count: int,
) -> tuple[NDArray[np.float64], list[LevelVariances]]:
    """See `LevelledErrors`; a source that does not know tells no levels."""
    if isinstance(errors, LevelledErrors):
        return errors.combined_by_level(wanted, gains, count)
    return combined(errors, wanted, gains), []


def covariances(errors: CovarianceSource, wanted: Sequence[Points]) -> list[NDArray[np.float64]]:
    """Covariances of the points of several outputs, what they share being worked out once.

    Parameters
    ----------
    errors : CovarianceSource
    wanted : sequence of Points

    Returns
    -------
    list of ndarray, each shape (2 n_in n_f, 2 n_in n_f)
    """
    if isinstance(errors, JointErrors):
        return errors.covariances(wanted)
    return [
        errors.covariance(np.array([each.output]), each.inputs, each.frequencies)[0]
        for each in wanted
    ]


def combined(
    errors: CovarianceSource, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Covariance of a sum of gains times errors, across outputs, inputs and frequencies.

    Nothing is kept but the result, however many points there are.

    Parameters
    ----------
    errors : CovarianceSource
        Where it knows one output at a time only, different outputs are taken as independent.
    wanted : sequence of Points
    gains : sequence of ndarray, each shape (n_rows, 2 n_in n_f)
        Columns ordered as the rows of `CovarianceSource.covariance`.

    Returns
    -------
    ndarray, shape (n_rows, n_rows)
    """
    if isinstance(errors, JointErrors):
        return errors.combined(wanted, gains)
    blocks = covariances(errors, wanted)
    parts = [gain @ block @ gain.T for gain, block in zip(gains, blocks, strict=True)]
    return np.asarray(np.sum(parts, axis=0))


def knows_between_outputs(errors: CovarianceSource) -> bool:
    """Whether a source knows what different outputs share."""
    if isinstance(errors, ErrorSelection):
        return knows_between_outputs(errors.errors)
    return isinstance(errors, JointErrors)


def union(wanted: Sequence[Points]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """All inputs and all frequencies of some points, in order."""
    inputs = np.unique(np.concatenate([each.inputs for each in wanted]))
    frequencies = np.unique(np.concatenate([each.frequencies for each in wanted]))
    return inputs, frequencies


@dataclass(frozen=True)
class ErrorSelection:
    """Errors of some outputs, inputs and frequencies of a response."""

    errors: CovarianceSource
    outputs: NDArray[np.intp]
    inputs: NDArray[np.intp]
    frequencies: NDArray[np.intp]

    def covariance(
        self,
        outputs: NDArray[np.intp],
        inputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """See `CovarianceSource`."""
        return self.errors.covariance(
            self.outputs[outputs], self.inputs[inputs], self.frequencies[frequencies]
        )

    def covariances(self, wanted: Sequence[Points]) -> list[NDArray[np.float64]]:
        """See `JointErrors`."""
        return covariances(self.errors, self._there(wanted))

    def combined(
        self, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """See `JointErrors`."""
        return combined(self.errors, self._there(wanted), gains)

    def by_level(
        self, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]]
    ) -> list[LevelProducts | None]:
        """See `LevelledErrors`."""
        return by_level(self.errors, self._there(wanted), gains)

    def combined_by_level(
        self, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]], count: int
    ) -> tuple[NDArray[np.float64], list[LevelVariances]]:
        """See `LevelledErrors`."""
        return combined_by_level(self.errors, self._there(wanted), gains, count)

    def _there(self, wanted: Sequence[Points]) -> list[Points]:
        return [
            Points(
                int(self.outputs[each.output]),
                self.inputs[each.inputs],
                self.frequencies[each.frequencies],
            )
            for each in wanted
        ]


@dataclass(frozen=True)
class StoredCovariance:
    """A covariance at all frequencies that was computed before (or read from a file).

    Attributes
    ----------
    matrix : ndarray, shape (n_out, 2 n_in n_f, 2 n_in n_f)
    n_frequencies : int
    """

    matrix: NDArray[np.float64]
    n_frequencies: int

    def covariance(
        self,
        outputs: NDArray[np.intp],
        inputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """See `CovarianceSource`."""
        half = self.matrix.shape[1] // 2
        real = np.add.outer(inputs * self.n_frequencies, frequencies).ravel()
        rows = np.concatenate([real, real + half])
        return np.asarray(self.matrix[np.ix_(outputs, rows, rows)])
