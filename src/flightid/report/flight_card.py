"""The card that a pilot takes to the field: one page of A4, no scripts."""

from __future__ import annotations

from flightid.planning import SweepPlan
from flightid.report.html import environment
from flightid.table import Table
from flightid.version import VERSION

SHOWN_SETTINGS = 12
"""Settings of an axis on the card; the files have all."""


def card_html(plan: SweepPlan) -> str:
    """Draw a flight plan as a card to print.

    Parameters
    ----------
    plan : SweepPlan

    Returns
    -------
    str
        The whole page.

    Example
    -------
    >>> import flightid as fid
    >>> page = card_html(fid.plan_flight(vehicle="quad", axes=("roll",)))
    >>> page.count("SID_AXIS 10")
    1
    """
    names: dict[str, list[str]] = {}
    for sweep in plan.sweeps:
        shown = {each.name: _number(each.value) for each in sweep.changes[:SHOWN_SETTINGS]}
        said = ", ".join(f"{name} {value}" for name, value in shown.items())
        if said and plan.is_go:
            names.setdefault(said, []).append(sweep.axis)
    return (
        environment()
        .get_template("card.html")
        .render(
            plan=plan,
            tables=[_shown(table) for table in plan._tables()],
            settings=[(", ".join(axes), said) for said, axes in names.items()],
            findings=[each for each in plan.findings if str(each.light) != "green"],
            verdict=plan.verdict,
            version=VERSION,
        )
    )


def _number(value: float) -> str:
    """A setting as it is typed: bits of a mask are whole, however many digits they have."""
    return f"{value:.0f}" if value.is_integer() else f"{value:.5g}"


def _shown(table: Table) -> dict[str, object]:
    return {
        "heads": [(column.name, column.unit) for column in table.columns],
        "rows": table.shown(),
        "title": table.title,
    }
