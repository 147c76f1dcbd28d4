"""Numbers as they are typed: 0.0025, 2.5e-3, or a fraction such as 1/400."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click
from click.types import FloatParamType

if TYPE_CHECKING:
    Base = click.ParamType[Any]
else:
    Base = object


class _Fractions(Base):
    """What `click` makes of a number, and of a fraction."""

    def convert(
        self,
        value: Any,  # noqa: ANN401 — as click hands it over
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """The number."""
        return super().convert(quotient(value), param, ctx)


class Quotient(_Fractions, FloatParamType):
    """A number, or a fraction of two."""


class QuotientRange(_Fractions, click.FloatRange):
    """The same between bounds."""


FIGURE = Quotient()


def quotient(value: Any) -> Any:  # noqa: ANN401 — as `click` hands it over
    """What a fraction is; anything else as it is.

    Example
    -------
    >>> quotient("1/400"), quotient("2.5"), quotient("1/0"), quotient("a/b")
    (0.0025, '2.5', '1/0', 'a/b')
    """
    above, slash, below = value.partition("/") if isinstance(value, str) else ("", "", "")
    if not slash:
        return value
    try:
        return float(above) / float(below)
    except (ValueError, ZeroDivisionError):
        return value
