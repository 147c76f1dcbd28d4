"""Several models verified on the same records, side by side."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.prediction.weights import weighted_error
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.validation.verification.result import Verification

N_STRETCHES = 12
"""Stretches of time over which errors are compared; 2^11 ways to swap the models are counted."""
SIGNIFICANCE = 0.05


@dataclass(frozen=True)
class Contrast:
    """One output as two models predict it.

    Attributes
    ----------
    output, unit : str
        Channel.
    first, rival : str
        Names of the models.
    first_rms, rival_rms : float
        Errors, in the unit.
    stretches_better : int
        In how many of `N_STRETCHES` equal stretches of time the first errs less.
    p_value : float
        Chance of a difference as large or larger if the two models were equally good.

    Example
    -------
    >>> pair = Contrast("p", "deg/s", "identified", "book", 0.5, 2.0, 11, 0.002)
    >>> pair.better, round(pair.change_percent)
    ('identified', -75)
    """

    output: str
    unit: str
    first: str
    rival: str
    first_rms: float
    rival_rms: float
    stretches_better: int
    p_value: float

    @property
    def better(self) -> str | None:
        """Name of the better model; None where the records cannot tell."""
        if self.p_value > SIGNIFICANCE:
            return None
        return self.first if self.first_rms < self.rival_rms else self.rival

    @property
    def change_percent(self) -> float:
        """Error of the first model against the rival's, percent; negative is less."""
        if self.rival_rms == 0:
            return 0.0 if self.first_rms == 0 else float("inf")
        return 100.0 * (self.first_rms / self.rival_rms - 1.0)

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "output": self.output,
            "unit": self.unit,
            "first": self.first,
            "rival": self.rival,
            "first_rms": self.first_rms,
            "rival_rms": self.rival_rms,
            "stretches_better": self.stretches_better,
            "p_value": self.p_value,
            "better": self.better,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result, schema="flightid.comparison/1"):
    """Models side by side on records that none of them has seen; the first is on trial.

    Attributes
    ----------
    verifications : mapping of str to Verification
        By name of the model; the same records, outputs and freedom for each.
    contrasts : tuple of Contrast
        The first model against each rival, by output.
    findings : tuple of Finding
        Which is better and by how much, then the verdicts on the first model.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> time_s = np.arange(600) * 0.02
    >>> lag, slow = (
    ...     fid.LinearSystem([[-rate]], [[rate]], [[1.0]], [[0.0]], ("u",), ("y",))
    ...     for rate in (2.0, 1.0))
    >>> flown = fid.Record.from_arrays(time_s, inputs={"u": np.sign(np.sin(time_s))})
    >>> fid.verify([lag, slow], fid.simulate(lag, flown), names=["right", "slow"])
    Comparison(2 models, 1 output, 1 record, 'right' better in 1, worse in 0)
    """

    verifications: Mapping[str, Verification]
    contrasts: tuple[Contrast, ...]
    findings: tuple[Finding, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the models, the one on trial first."""
        return tuple(self.verifications)

    @property
    def first(self) -> Verification:
        """The model on trial."""
        return self.verifications[self.names[0]]

    @property
    def outputs(self) -> tuple[str, ...]:
        """Outputs compared."""
        return self.first.outputs

    def contrast(self, output: str, rival: str | None = None) -> Contrast:
        """The first model against a rival (default: the first rival) in one output."""
        wanted = self.names[1] if rival is None else rival
        return next(
            each for each in self.contrasts if (each.output, each.rival) == (output, wanted)
        )

    def summary(self) -> Table:
        """Table by output: Theil coefficient and error of each model, and which is better."""
        columns = [Column("output"), Column("unit")]
        columns += [Column(f"better than {name}") for name in self.names[1:]]
        columns += [Column(f"Theil, {name}", digits=3) for name in self.names]
        columns += [Column(f"rms error, {name}", digits=3) for name in self.names]
        rows: list[tuple[Cell, ...]] = []
        for output in self.outputs:
            each = self.verifications.values()
            cells: list[Cell] = [output, self.first.measured.unit(output)]
            cells += [_word(self.contrast(output, rival)) for rival in self.names[1:]]
            cells += [result.theil[output] for result in each]
            cells += [result.rms_error[output] for result in each]
            rows.append(tuple(cells))
        notes = [
            f"{name}: {weighted_error(result.j_rms, map(result.measured.unit, result.outputs))}."
            for name, result in self.verifications.items()
            if result.j_rms is not None
        ]
        notes = [self.first.protocol, *notes, *map(str, self.findings)]
        return Table(repr(self), tuple(columns), tuple(rows), tuple(notes))

    def _computed(self) -> dict[str, object]:
        return {"names": self.names}

    def __repr__(self) -> str:
        """Size, and in how many outputs the first model is better than a rival, on one line."""
        ahead = sum(each.better == each.first for each in self.contrasts)
        behind = sum(each.better == each.rival for each in self.contrasts)
        outputs = "1 output" if len(self.outputs) == 1 else f"{len(self.outputs)} outputs"
        count = len(self.first.predictions)
        records = "1 record" if count == 1 else f"{count} records"
        return (
            f"Comparison({len(self.names)} models, {outputs}, {records}, "
            f"{self.names[0]!r} better in {ahead}, worse in {behind})"
        )


def compared(verifications: Mapping[str, Verification]) -> Comparison:
    """Put verifications on the same records and outputs side by side.

    Whether a difference counts is tested without any law for the errors: if two models were
    equally good, swapping them in any stretch of time would be as likely as not, so the observed
    difference of squared errors is placed among those of all swaps.

    Assumes: errors of one stretch hardly depend on those of the next. Biased towards differences
    where errors live longer than a twelfth of the records.

    Parameters
    ----------
    verifications : mapping of str to Verification
        By name of the model, the one on trial first; two or more.

    Reference
    ---------
    Good, Permutation, Parametric and Bootstrap Tests of Hypotheses, 3rd ed., section 3.2 (paired
    observations).

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> lag = fid.LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> flown = fid.Record.from_arrays(
    ...     np.arange(300) * 0.02, inputs={"u": np.sin(np.arange(300) * 0.02)})
    >>> same = fid.verify(lag, fid.simulate(lag, flown))
    >>> compared({"a": same, "b": same}).contrasts[0].better is None
    True
    """
    first, *rivals = verifications
    contrasts = tuple(
        _contrast(output, first, rival, verifications)
        for rival in rivals
        for output in verifications[first].outputs
    )
    found = [_finding(each) for each in contrasts]
    for rival in rivals:
        found += _overall(first, rival, verifications)
    on_trial = verifications[first].findings
    return Comparison(dict(verifications), contrasts, (*found, *on_trial))


def _contrast(
    output: str, first: str, rival: str, verifications: Mapping[str, Verification]
) -> Contrast:
    ours, theirs = verifications[first], verifications[rival]
    gain = _squares(theirs, output) - _squares(ours, output)
    by_stretch = np.array([np.sum(part) for part in np.array_split(gain, N_STRETCHES)])
    return Contrast(
        output,
        ours.measured.unit(output),
        first,
        rival,
        ours.rms_error[output],
        theirs.rms_error[output],
        int(np.sum(by_stretch > 0)),
        swap_p_value(by_stretch),
    )


def _squares(result: Verification, output: str) -> NDArray[np.float64]:
    return np.concatenate([each.residual(output)[each.start :] ** 2 for each in result.predictions])


def swap_p_value(differences: NDArray[np.float64]) -> float:
    """Two-sided p-value of a sum of differences among all changes of their signs.

    Parameters
    ----------
    differences : ndarray, shape (n,)
        Differences of paired observations; n at most 20.

    Returns
    -------
    float
        Exact; 1 where all differences are zero.

    Example
    -------
    >>> swap_p_value(np.ones(12)) == 2 / 2**12
    True
    """
    # The sign of the first is kept: a pattern and its mirror image have the same size.
    n = differences.size
    codes = np.arange(2 ** (n - 1))[:, None] >> np.arange(n - 1)
    signs = np.hstack([np.ones((len(codes), 1)), 1.0 - 2.0 * (codes & 1)])
    sums = np.abs(signs @ differences)
    observed = abs(float(np.sum(differences)))
    # Sums that are equal but for rounding count as equal.
    return float(np.mean(sums >= observed - 1e-12 * np.sum(np.abs(differences))))


def _word(contrast: Contrast) -> str:
    if contrast.better is None:
        return "cannot tell"
    size = (
        f"{abs(contrast.change_percent):.0f} % {'less' if contrast.change_percent < 0 else 'more'}"
    )
    return f"{'yes' if contrast.better == contrast.first else 'no'}, {size}"


def _finding(contrast: Contrast) -> Finding:
    unit = "" if contrast.unit == "1" else f" {contrast.unit}"
    numbers = (
        f"{contrast.output}: {contrast.first} errs by {contrast.first_rms:.3g}{unit}, "
        f"{contrast.rival} by {contrast.rival_rms:.3g}"
    )
    counted = (
        f"{contrast.first} closer in {contrast.stretches_better} of {N_STRETCHES} stretches, "
        f"p = {contrast.p_value:.2g}"
    )
    if contrast.better is None:
        message = f"{numbers}; the records cannot tell which is better ({counted})"
        return Finding("comparison-output", Light.UNKNOWN, message)
    message = f"{numbers}; {contrast.better} is better ({counted})"
    if contrast.better == contrast.first:
        return Finding("comparison-output", Light.GREEN, message)
    return Finding("comparison-output", Light.AMBER, message, "look at what the rival models here")


def _overall(
    first: str, rival: str, verifications: Mapping[str, Verification]
) -> tuple[Finding, ...]:
    ours, theirs = verifications[first].j_rms, verifications[rival].j_rms
    if ours is None or theirs is None:
        return ()
    light = Light.GREEN if ours <= theirs else Light.AMBER
    return (
        Finding(
            "comparison-j-rms",
            light,
            f"weighted error over all outputs: {first} {ours:.3g}, {rival} {theirs:.3g} "
            "(deg, deg/s, ft/s, ft/s²)",
            "" if light is Light.GREEN else f"{rival} is the better model on these records",
        ),
    )
