"""What an innovations model adds to a fit: the choice of its order, roots and gains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flightid.frozen import dataclass
from flightid.identification.prediction_error.details import PolynomialDetails
from flightid.identification.subspace.order import OrderChoice
from flightid.table import Table
from flightid.uncertainty.estimate import Estimate


@dataclass(frozen=True, eq=False, kw_only=True)
class SubspaceDetails(PolynomialDetails):
    """Beside the matrices of an innovations model, whose entries depend on the choice of states.

    Roots hold the poles, shared by all responses, and the zeros of each response; the loss of the
    criteria is the determinant of the innovations' covariance.

    Attributes
    ----------
    order : OrderChoice
        Singular values and criteria of all candidate orders.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> truth = fid.InnovationsModel(("u",), ("y",), 0.1, [[0.9, 0.2], [-0.2, 0.9]],
    ...                              [[1.0], [0.5]], [[1.0, 0.0]])
    >>> u = np.random.default_rng(0).standard_normal(400)
    >>> record = fid.Record.from_arrays(np.arange(400) / 10, inputs={"u": u},
    ...                                 outputs={"y": np.zeros(400)})
    >>> record = record.replace({"y": truth.simulate(record)[0]})
    >>> fit = fid.identify(fid.InnovationsModel.subspace("u", "y", offsets="none"), record)
    >>> fit.model.order, fit.details.words
    (2, 'free-run fit y 100.0 %')
    >>> fit.details.modes[0]
    FittedRoot(pole of all responses at 0.9 ± 0.2i)
    """

    order: OrderChoice

    def quantities(self, parameters: Mapping[str, Estimate]) -> Sequence[Estimate]:  # noqa: ARG002
        """Natural frequencies, dampings and steady gains: entries of the matrices mean nothing."""
        found = [each for root in self.modes for each in (root.natural_frequency, root.damping)]
        return (*(each for each in found if each is not None), *self.gains.values())

    def tables(self) -> tuple[Table, ...]:
        """Poles and zeros, and the candidate orders with their singular values."""
        return (*super().tables(), self.order.summary())

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {**super().to_dict(), "order": self.order.to_dict()}
