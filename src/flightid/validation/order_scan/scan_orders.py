"""Scan of orders, delays and kinds, ranked by free run on unseen records (`order_scan.rs`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Unpack

import numpy as np

from flightid.errors import DataError, OptionError
from flightid.identification.prediction.request import usual_stretch
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.polynomial.orders import ANY, USED, ScanOptions
from flightid.models.polynomial.structure import PolynomialOptions, PolynomialStructure
from flightid.models.sampled.channels import SampledChannels, gather_channels
from flightid.record import Record
from flightid.record.several import as_records
from flightid.validation.order_scan.edges import Structure
from flightid.validation.order_scan.every_kind import (
    SEARCHED,
    box_jenkins_of,
    narx_of,
    subspace_of,
)
from flightid.validation.order_scan.result import (
    OrderScan,
    OrderTrial,
    Range,
    rank_of,
    whole_numbers,
)
from flightid.validation.order_scan.trials import ScanRecords, delivered, fit_of, trials_of

MOST = 20_000


def scan_orders(
    records: Record | Sequence[Record],
    validation: Record | Sequence[Record],
    *,
    inputs: Sequence[str] | None = None,
    outputs: str | None = None,
    kind: str = "armax",
    na: Range = range(1, 5),
    nb: Range = range(1, 5),
    nc: Range = range(1, 4),
    nd: Range = range(1, 3),
    nf: Range = range(1, 5),
    nk: Range = 1,
    **options: Unpack[PolynomialOptions],
) -> OrderScan:
    """Fit all combinations of orders and delays; rank them by free run on records not fitted.

    ARX and ARMAX structures come from one triangle of the largest regressor matrix, ARMAX refined
    by prediction errors from there; OE and BJ are fitted one by one. All are judged on the same
    samples; the start of a free run is solved for on the first tenth of a record alone (NARX
    starts from measured lags), which no score counts, and no mean of it is told. The information
    criteria are shown beside it, and which structure each would take: the smallest value over the
    whole scan, not the first increase.

    Kind "any" ranks ARX, ARMAX and OE of these orders, BJ at the best OE's orders, subspace models
    and NARX of as many lags, each in its own words, by the same free runs over the same samples.

    Parameters
    ----------
    records, validation : Record or sequence of Record
        Records of the fits and of the free runs.
    outputs : str, optional
        Default: the only output.
    inputs : sequence of str, optional
        Default: all inputs.
    kind : {"armax", "arx", "oe", "bj", "any"}
    na, nb, nc, nd, nf, nk : int or iterable of int
        Orders to try, those that the kind has; nb, nf and nk alike for all inputs. OE and BJ of
        several inputs are tried with a denominator in common and with one each, unless
        ``denominators`` says which.
    **options
        Of the fit of the best structure and of OE and BJ fits; see `PolynomialStructure`.

    Returns
    -------
    OrderScan
        Trials, the smallest free-run error first, and the full fit of the best.

    Raises
    ------
    OptionError
        An unknown kind, an empty or too large scan, several outputs.
    DataError
        Constant channels, records shorter than the lags, other sample times.
    FitError
        No structure could be fitted.

    Assumes
    -------
    Validation records with other inputs than those of the fit: on the same record a free run
    still favours large models.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., sections 10.1, 16.4 and 16.5.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> truth = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]], nk=(2,))
    >>> def fly(seed):
    ...     u, noise = np.random.default_rng(seed).standard_normal((2, 400))
    ...     record = fid.Record.from_arrays(np.arange(400) / 10, inputs={"u": u},
    ...                                     outputs={"y": np.zeros(400)})
    ...     return record.replace({"y": truth.simulate(record) + 0.05 * noise})
    >>> scan = scan_orders(fly(0), fly(1), nk=range(1, 4))
    >>> scan.smallest("bic").structure.nk
    (2,)
    """
    fitted = list(as_records(records))
    unseen = list(as_records(validation))
    if not fitted or not unseen:
        raise OptionError("a scan needs records to fit and records to validate on")
    name, names = _channels(fitted[0], outputs, inputs)
    orders = {"na": na, "nb": nb, "nc": nc, "nd": nd, "nf": nf, "nk": nk}
    ScanOptions(kind=kind)
    asked = {
        each: _structures(each, name, names, orders, options)
        for each in (SEARCHED if kind == ANY else (kind,))
    }
    structures = [structure for group in asked.values() for structure in group]
    data, check = _gathered(structures[0], fitted, unseen)
    scan = ScanRecords(fitted, unseen, _settle_s(structures, unseen))
    trials: list[OrderTrial] = []
    for group in asked.values():
        trials += trials_of(group, data, check, scan)
    if kind == ANY:
        trials += trials_of(box_jenkins_of(trials, orders), data, check, scan)
        trials += trials_of(subspace_of(structures), data, check, scan)
        trials += trials_of(narx_of(trials, whole_numbers("nb", nb)), data, check, scan)
    ranked, best = delivered(trials, scan)
    return OrderScan(
        kind, tuple(ranked), best, tuple(r.name for r in unseen), scan.settle_s, data.units[name]
    )


def scan_further(
    scan: OrderScan,
    structures: Sequence[Structure],
    records: Sequence[Record],
    validation: Sequence[Record],
) -> tuple[OrderScan, list[OrderTrial]]:
    """A scan with further structures of one kind, scored over the same samples, and their trials.

    Parameters
    ----------
    scan : OrderScan
    structures : sequence
    records, validation : sequence of Record
        Those of the scan.
    """
    asked = next(
        each.structure for each in scan.trials if isinstance(each.structure, PolynomialStructure)
    )
    data, check = _gathered(asked, records, validation)
    taken = ScanRecords(records, validation, scan.settle_s)
    made = trials_of(structures, data, check, taken)
    if all(each.model is None for each in made):
        return scan, made
    more, best = delivered(made, taken)
    known = {(each.kind, each.structure.orders_text) for each in scan.trials}
    new = [each for each in more if (each.kind, each.structure.orders_text) not in known]
    first = scan.trials[0]
    if new and rank_of(new[0]) < rank_of(first):
        best = best if new[0] is more[0] else fit_of(new[0], records)
    else:
        best = scan.best
    ranked = tuple(sorted([*scan.trials, *new], key=rank_of))
    return replace(scan, trials=ranked, best=best), more


def _gathered(
    asked: PolynomialStructure, records: Sequence[Record], validation: Sequence[Record]
) -> tuple[SampledChannels, SampledChannels]:
    """Channels of what is fitted, and of what is run freely."""
    data = gather_channels(list(records), asked.output, asked.inputs, asked.offsets)
    data.require_change()
    check = gather_channels(list(validation), asked.output, asked.inputs, asked.offsets)
    if abs(check.sample_time_s / data.sample_time_s - 1.0) > 1e-6:
        raise DataError(
            "records and validation have different sample times",
            found=f"{data.sample_time_s:.6g} and {check.sample_time_s:.6g} s",
            action="resample them with conditioning.resample",
        )
    return data, check


def _channels(
    record: Record, output: str | None, inputs: Sequence[str] | None
) -> tuple[str, tuple[str, ...]]:
    if output is None:
        if len(record.outputs) != 1:
            raise OptionError(
                "the output to model is not said",
                found=", ".join(record.outputs) or "no output",
                needed="output='…'",
            )
        output = record.outputs[0]
    return output, tuple(record.inputs if inputs is None else inputs)


def _structures(
    kind: str,
    output: str,
    inputs: tuple[str, ...],
    orders: dict[str, Range],
    options: PolynomialOptions,
) -> list[PolynomialStructure]:
    used = USED[kind]
    choices = [whole_numbers(name, orders[name]) for name in used]
    count = int(np.prod([len(choice) for choice in choices]))
    if count > MOST:
        raise OptionError(
            "the scan is too large", found=f"{count} structures", needed=f"at most {MOST}"
        )
    made: list[PolynomialStructure] = []
    for values in product(*choices):
        chosen = dict(zip(used, values, strict=True))
        made += PolynomialModel.general(inputs, output, **chosen, **options).alternatives
    return made


def _settle_s(structures: Sequence[PolynomialStructure], unseen: Sequence[Record]) -> float:
    """One first stretch for all structures, so that all are scored on the same samples, s."""
    most = max(s.na + sum(s.nf) for s in structures)
    shortest = min(record.n_samples for record in unseen)
    return usual_stretch(shortest, most) * unseen[0].sample_time_s
