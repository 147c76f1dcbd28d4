"""Partial coherence of records that come one after the other and are not kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.responses.estimators.composite import Composite, combine
from flightid.responses.estimators.conditioned import condition
from flightid.responses.spectra import Spectra, average_spectra
from flightid.responses.windows.defaults import DEFAULT_OVERLAP, plan_of, shifts_of
from flightid.responses.windows.planning import valid_windows
from flightid.responses.windows.transform import FoldedBasis


class SpectralSum:
    """Spectra of all channels, summed over records; memory does not grow with their number.

    What `composite` gives is what `estimate_response` finds with ``estimator="composite"`` in the
    same records and windows, to rounding. Bias: that of a direct estimate.

    Parameters
    ----------
    channels : sequence of str
        Rows of what is added.
    window_s : sequence of float
        Window lengths, s.
    omega_rad_s : ndarray, shape (n_f,)
        Frequencies, rad/s.
    sample_time_s : float
        Of every record, s.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., chapters 9, 10.

    Example
    -------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> total = SpectralSum(("u", "y"), [2.0], np.array([5.0, 20.0]), 0.01)
    >>> for _ in range(9):
    ...     u = rng.standard_normal(1000)
    ...     total.add(np.array([u, u + rng.standard_normal(1000)]))
    >>> bool(np.all(np.abs(total.composite(["u"], ["y"]).coherence - 0.5) < 0.15))
    True
    """

    def __init__(
        self,
        channels: Sequence[str],
        window_s: Sequence[float],
        omega_rad_s: NDArray[np.float64],
        sample_time_s: float,
    ) -> None:
        self._row = {name: row for row, name in enumerate(channels)}
        self._omega, self._step = omega_rad_s, sample_time_s
        shifts = shifts_of(DEFAULT_OVERLAP)
        plans = {plan_of(one, sample_time_s, shifts) for one in window_s}
        self._plans = sorted(plans, key=lambda plan: -plan.length)
        self._bases = [
            FoldedBasis.of(plan, omega_rad_s * sample_time_s, "mean") for plan in self._plans
        ]
        shape = (omega_rad_s.size, len(self._row), len(self._row))
        self._sums = [Spectra(plan, np.zeros(shape, complex), 0, 0.0) for plan in self._plans]

    def add(self, samples: NDArray[np.float64] | Mapping[str, NDArray[np.float64]]) -> None:
        """Take the windows of a record; none where it is shorter than one.

        Parameters
        ----------
        samples : ndarray, shape (n_channels, n), or mapping of str to ndarray of shape (n,)
            Rows in the order of `channels`, or by name.
        """
        if isinstance(samples, Mapping):
            samples = np.array([samples[name] for name in self._row])
        for at, (basis, total) in enumerate(zip(self._bases, self._sums, strict=True)):
            if samples.shape[1] < basis.plan.length:
                continue
            more = average_spectra([samples], basis, self._step)
            self._sums[at] = replace(
                total,
                matrix=total.matrix + more.n_windows * more.matrix,
                n_windows=total.n_windows + more.n_windows,
                n_independent=total.n_independent + more.n_independent,
            )

    def composite(self, inputs: Sequence[str], outputs: Sequence[str]) -> Composite:
        """Composite spectra of every output with every input, the other inputs taken out.

        Raises
        ------
        DataError
            An input without power, inputs that cannot be told apart, or too few windows.
        """
        rows = [self._row[name] for name in (*inputs, *outputs)]
        parts = []
        for total in self._sums:
            matrix = total.matrix[:, rows][:, :, rows] / max(total.n_windows, 1)
            one = replace(total, matrix=matrix)
            parts.append(condition(one, len(inputs), self._omega, tuple(inputs)))
        return combine(parts, valid_windows(self._plans, self._omega, self._step))
