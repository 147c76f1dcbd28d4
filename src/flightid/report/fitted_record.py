"""What a report shows of a time-domain fit: every record, measured and modelled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flightid.plot.fitted_record import record_figure
from flightid.report.content import Figure
from flightid.report.figures import figure_block

if TYPE_CHECKING:
    from flightid.identification import Fit


def record_figures(fit: Fit) -> list[Figure]:
    """Draw every record of a fit.

    Parameters
    ----------
    fit : Fit
        Of records.

    Returns
    -------
    list of Figure
    """
    return [
        figure_block(
            record_figure(item),
            f"Record {item.measured.name}: inputs, outputs as measured and as the fitted model "
            "gives them with the record's own initial state and biases, and what is left.",
        )
        for item in fit.records
    ]
