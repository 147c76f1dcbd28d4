"""Linear state-space models in innovations form: x(t+1) = A x + B u + K e, y = C x + D u + e."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Self, Unpack

import numpy as np

from flightid.models.innovations.description import innovations_from_table, innovations_to_table
from flightid.models.innovations.form import Array, InnovationsForm
from flightid.models.innovations.prediction import forced_run
from flightid.models.innovations.structure import SubspaceOptions, SubspaceStructure
from flightid.models.sampled.channels import gather_channels, hold_diverged, require_same
from flightid.models.sampled.discrete_modes import roots_table
from flightid.record import Record
from flightid.result import TableView
from flightid.table import Table


class InnovationsModel(InnovationsForm, TableView):
    """x(t+1) = A x(t) + B u(t) + K e(t), y(t) = C x(t) + D u(t) + e(t).

    Channels are deviations from an operating point, in the channels' units; the states have no
    meaning of their own.

    Attributes
    ----------
    inputs, outputs : tuple of str
        p and m channel names.
    sample_time_s : float
        Sample time T, s.
    a, b, c, d, k : ndarray, shapes (n, n), (n, m), (p, n), (p, m), (n, p)
        D and K are zero when left out.
    noise_covariance : ndarray, shape (p, p), or None
        Of the innovations e, in the units of the outputs.
    units : mapping of str to str
        By channel; a channel left out is dimensionless.
    name : str
    operating_point : mapping of str to float
        Value of each channel about which the model holds, in its unit: where the training records
        were. A channel left out counts from zero.
    estimated : EstimateProvenance or None
        What a fit knew of the parameters, where the model comes from its file.

    Raises
    ------
    ModelError
        Matrices that do not fit, are not finite, or a sample time that is not positive.

    Example
    -------
    >>> roll = InnovationsModel(("aileron",), ("p",), 0.1, [[0.8]], [[2.0]], [[1.0]])
    >>> roll
    InnovationsModel(1 state, p from aileron, T 0.1 s)
    >>> roll.poles()
    array([0.8+0.j])
    """

    @staticmethod
    def subspace(
        inputs: str | Sequence[str],
        outputs: str | Sequence[str],
        order: int | None = None,
        **options: Unpack[SubspaceOptions],
    ) -> SubspaceStructure:
        """Structure for `flightid.identify`; `SubspaceStructure` says the options.

        Parameters
        ----------
        inputs, outputs : str or sequence of str
        order : int, optional
            Number of states; default: chosen from the singular values.
        **options
            ``method``, ``horizon``, ``direct``, …
        """
        names = tuple(
            (each,) if isinstance(each, str) else tuple(each) for each in (outputs, inputs)
        )
        return SubspaceStructure(names[0], names[1], order, **options)

    def simulate(self, record: Record) -> Array:
        """Free run from rest on the inputs as they are, shape (p, n_samples), outputs' units."""
        first, *others = (*self.outputs, *self.inputs)
        data = gather_channels([record], first, others, "none")
        require_same(self, data.units, data.sample_time_s)
        with np.errstate(over="ignore", invalid="ignore"):
            run = forced_run(self, data.inputs[len(self.outputs) - 1 :])
        hold_diverged(run)
        return run

    def summary(self) -> Table:
        """Table of poles, and of the zeros of each response."""
        zeros = [(response, (), found) for response, found in self.zeros().items()]
        return roots_table(repr(self), [("all", self.modes(), None), *zeros])

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key, which `from_dict` and TOML files take back."""
        return innovations_to_table(self)

    @classmethod
    def from_dict(cls, content: Mapping[str, object]) -> Self:
        """Model from plain values such as a TOML file gives.

        Raises
        ------
        ModelError
            A key is missing, unknown or of the wrong type, or the matrices do not fit.
        """
        return cls(**innovations_from_table(content))

    def __repr__(self) -> str:
        """Size, channels and sample time on one line."""
        states = f"{self.order} state{'' if self.order == 1 else 's'}"
        channels = f"{', '.join(self.outputs)} from {', '.join(self.inputs)}"
        return f"InnovationsModel({states}, {channels}, T {self.sample_time_s:.4g} s)"
