"""Join blocks by the names of their signals."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.control.loops.block import Block
from flightid.control.loops.elements import system
from flightid.control.loops.interconnection import Interconnection


def connect(
    blocks: Sequence[object],
    *,
    inputs: Sequence[str],
    outputs: Sequence[str] | None = None,
    name: str = "loops",
) -> Interconnection:
    """Join blocks whose signals have the same name.

    Parameters
    ----------
    blocks : sequence of Block, fit, model, LinearSystem or Interconnection
        A model stands between its own channels, as by `flightid.loops.system`. The signals inside
        an interconnection that are no outputs of it get its name before theirs.
    inputs : sequence of str
        Signals from outside.
    outputs : sequence of str, optional
        Signals to look at; all that blocks give when left out.
    name : str
        For tables and pictures.

    Raises
    ------
    ModelError
        A signal with two sources, an algebraic loop without a solution, sampled signals that meet
        continuous blocks or another sample time.
    UnknownNameError
        A signal without a source, or an output that is no signal.
    UnitError
        Two blocks that disagree on the unit of a signal.

    Reference
    ---------
    Skogestad & Postlethwaite, *Multivariable Feedback Control*, 2nd ed., section 3.2: closing
    loops by solving for all signals at once.

    Example
    -------
    >>> import flightid as fid
    >>> roll = fid.LinearSystem([[-4.0]], [[20.0]], [[1.0]], [[0.0]], ("lat",), ("p",))
    >>> damper = [fid.loops.washout("p", "p_w", 0.5), fid.loops.gain("p_w", "sas", -0.2)]
    >>> loop = connect([roll, *damper, fid.loops.sum_of("lat", "stick", "sas")],
    ...                inputs=["stick"], outputs=["p"])
    >>> loop.poles().real.round(3)
    array([-8.258, -0.242])
    """
    wanted: list[Block] = []
    for place, each in enumerate(blocks):
        wanted += blocks_of(each, place)
    given = tuple(signal for block in wanted for signal in block.outputs)
    made = Interconnection(
        tuple(wanted), tuple(inputs), tuple(given if outputs is None else outputs), name
    )
    _ = made.wiring.core  # refuses algebraic loops without a solution, in either kind of time
    return made


def blocks_of(each: object, place: int) -> list[Block]:
    """Blocks of one part of a connection; signals inside an interconnection get its name."""
    if isinstance(each, Block):
        return [each]
    if isinstance(each, Interconnection):
        inner = [n for n in each.signals if n not in (*each.inputs, *each.outputs)]
        names = {signal: f"{each.name}{place + 1}.{signal}" for signal in inner}
        return [block.renamed(names) for block in each.blocks]
    return [system(each)]
