"""Layouts of plots that a study names: a file of panes, which says nothing of any log."""

from __future__ import annotations

from pathlib import Path

from flightid.errors import OptionError, StudyError
from flightid.logs.field_plot import require_series
from flightid.reading import read_toml

MOST_PANES = 100


def layout_panes(path: str | Path) -> tuple[tuple[str, ...], ...]:
    r"""Fields, and formulas of fields, of each pane of a layout.

    Parameters
    ----------
    path : str or Path
        TOML file of tables ``[[pane]]`` with ``series``, as the page keeps it under ``plots/``.

    Raises
    ------
    StudyError
        It cannot be read, or a pane names nothing.

    Example
    -------
    >>> import tempfile
    >>> from flightid.files import write_atomically
    >>> text = '[[pane]]\nseries = ["ATT.Roll", "= ATT.Roll - ATT.DesRoll"]\n'
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     layout_panes(write_atomically(Path(folder) / "angles.toml", text))
    (('ATT.Roll', '= ATT.Roll - ATT.DesRoll'),)
    """
    place = Path(path)
    if not place.is_file():
        raise StudyError("the layout of a [[plot]] is not there", found=str(place), needed="a file")
    rows = read_toml(place, "a layout of plots", StudyError).get("pane")
    listed = rows if isinstance(rows, list) else []
    panes = [each.get("series") if isinstance(each, dict) else None for each in listed]
    try:
        if not panes or len(panes) > MOST_PANES:
            raise OptionError("no panes", found=len(panes), needed=f"1 to {MOST_PANES}")
        for pane in panes:
            if not isinstance(pane, list) or not pane:
                raise OptionError("a pane shows nothing", needed='series = ["MESSAGE.FIELD"]')
            for each in pane:
                require_series(each)
    except (OptionError, TypeError, AttributeError) as error:
        raise StudyError(
            f"{place.name} is no layout of plots",
            found=str(error),
            needed='tables [[pane]] with series = ["MESSAGE.FIELD"]',
        ) from error
    return tuple(tuple(pane) for pane in panes if isinstance(pane, list))
