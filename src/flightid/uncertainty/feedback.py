"""One test of whether a loop is closed around a vehicle: does past noise move an input.

An open loop leaves an input independent of the noise of the outputs. The noise is what a long ARX
model of the outputs leaves: it knows light damping by few numbers, where a pulse response of as
many lags has not died out. What is new in an input is what its own past does not foretell. Past
noise that explains a share of what is new says that a loop is closed. Either of the two being white
is enough for the F distribution, so neither a poor model of the outputs nor a held, swept or
two-level input raises false alarms. An input that repeats exactly cannot hold any noise.

A controller that answers within the sample hides its noise: the model of the outputs takes u(t) for
their cause. So what is new in an input is also held against the outputs of its own sample. Where
they go together, a vehicle that answers at once and a controller that does look the same, and the
loop is not known.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import OptionError
from flightid.record.history import Step, spread_channels
from flightid.record.hold import LOOPS

Array = NDArray[np.float64]
LEVEL = 0.01
"""Share of open loops that are called closed."""
LARGEST_ORDER = 20
"""Past samples of every channel in the model of the outputs, and of an input in that of its own."""
LAGS = 12
"""Past samples of noise that may move an input."""
SAMPLES_PER_NUMBER = 10
FEWEST_FREE = 30
SMALLEST_NOISE = 1e-8
"""Share of an output's power below which its noise is rounding, or cannot bias anything."""
NEARLY = 0.999
"""Share of what is new in an input from which outputs leave nothing else that moves it."""
RIDGE = 1e-11
"""Added to columns of unit length: noise 110 dB below each channel."""


@dataclass(frozen=True)
class FeedbackTest:
    """Whether a loop was closed around the vehicle, and how that is known.

    Attributes
    ----------
    loop : {"open", "closed", "unknown"}
    source : {"test", "declared", "repeats", "instrument", "noise model", "no noise", ...}
        How it is known: the test of past noise; the user's word; inputs that repeat exactly, or
        outputs without noise, which feed nothing back; an estimate by way of an excitation or of a
        model of the noise, which a closed loop does not bias. Or why it is not ("same sample", "too
        short", "filtered"): input and output go together within a sample; records too short to
        tell; samples made of later ones, which look like feedback.
    p_value : float or None
        Chance of so large a share with the loop open, over all inputs; None without a test.
    input : str or None
        Input that past noise explains most.
    share : float or None
        Share of what is new in it that past noise explains, or with source "same sample" the
        outputs up to its own sample.
    lags : int
        Past samples of noise that were asked.

    Example
    -------
    >>> FeedbackTest("open", "declared").is_closed
    False
    """

    loop: Literal["open", "closed", "unknown"]
    source: str
    p_value: float | None = None
    input: str | None = None
    share: float | None = None
    lags: int = LAGS

    @property
    def is_closed(self) -> bool:
        """Whether estimates from these inputs straight to outputs are biased."""
        return self.loop == "closed" and not self.is_taken_care_of

    @property
    def is_taken_care_of(self) -> bool:
        """Whether the way of estimating keeps a closed loop from bending it."""
        return self.source in ("instrument", "noise model")

    @property
    def is_function_of_outputs(self) -> bool:
        """Whether outputs leave nothing else that moves an input: a model may be a controller."""
        return self.source == "same sample" and (self.share or 0.0) >= NEARLY

    def __str__(self) -> str:
        """What is known and how, in a sentence."""
        words = {
            "declared": f"loop {self.loop}, as declared",
            "repeats": "loop open: the inputs repeat exactly, so nothing is fed back",
            "same sample": (
                f"whether a loop is closed cannot be told: outputs up to the same sample explain "
                f"{_percent(self.share)} % of what is new in input {self.input}, as a controller "
                "without delay or a vehicle that answers at once would"
            ),
            "instrument": "estimated by way of the excitation, which a closed loop does not bias",
            "noise model": "estimated with a model of the noise, which a closed loop does not bias",
            "no noise": "no loop seen: the outputs hold no noise that could be fed back",
            "filtered": (
                "whether a loop is closed cannot be told: channels were brought to another grid "
                "with samples from before and after it, so that outputs foretell inputs"
            ),
            "too short": "whether a loop is closed cannot be told: the records are too short",
        }
        if self.source in words:
            return words[self.source]
        said = "loop closed" if self.loop == "closed" else "no loop seen"
        return (
            f"{said}: past noise of the outputs explains {_percent(self.share)} % of what is new "
            f"in input {self.input} (p = {self.p_value:.2g})"
        )

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "loop": self.loop,
            "source": self.source,
            "p_value": self.p_value,
            "input": self.input,
            "share": self.share,
            "lags": self.lags,
        }


def _percent(share: float | None) -> str:
    """A share in percent, cut so that only all of it reads 100."""
    return f"{np.floor(1e4 * (share or 0.0)) / 100.0:.4g}"


def unless_spread(
    test: FeedbackTest, histories: Iterable[Iterable[Step]], names: Iterable[str]
) -> FeedbackTest:
    """A test of channels, "filtered" where some were without phase, which looks like feedback."""
    found = test.source == "test" and test.is_closed and spread_channels(histories, names)
    return replace(test, loop="unknown", source="filtered") if found else test


def declared_loop(loop: str) -> FeedbackTest:
    """The user's word.

    Raises
    ------
    OptionError
        Another word.
    """
    for word in LOOPS:
        if loop == word:
            return FeedbackTest(word, "declared")
    raise OptionError("loop is not known", found=repr(loop), needed="'open' or 'closed'")


def find_feedback(
    inputs: Sequence[Array],
    outputs: Sequence[Array],
    names: Sequence[str],
    *,
    repeats: bool = False,
    unthinned: tuple[Sequence[Array], Sequence[Array]] | None = None,
) -> FeedbackTest:
    """Test records for a closed loop.

    Parameters
    ----------
    inputs, outputs : sequence of ndarray, each shape (n_channels, n_samples)
        One array for each record, means removed.
    names : sequence of str
        Of the inputs.
    repeats : bool
        The inputs of every record repeat exactly.
    unthinned : tuple of two sequences of ndarray, optional
        Inputs and outputs at the records' own samples, where those given are thinned: what an input
        does between two kept samples looks like an answer within one.

    Returns
    -------
    FeedbackTest
        Feedback within the same sample cannot be told from direct feedthrough: where input and
        output go together within it, the loop is "unknown". Inputs that do not change are left out.

    Reference
    ---------
    Granger, "Investigating causal relations by econometric models and cross-spectral methods",
    *Econometrica* 37 (1969); Haugh, "Checking the independence of two covariance-stationary time
    series: a univariate residual cross-correlation approach", *J. Am. Statistical Association* 71
    (1976); Ljung, *System Identification*, 2nd ed., sections 13.4 and 14.4.

    Example
    -------
    >>> rng = np.random.default_rng(0)
    >>> u, e = rng.standard_normal((2, 3000))
    >>> y = np.convolve(u, [0.0, 0.5, 0.3])[:3000] + e
    >>> find_feedback([u[None]], [y[None]], ["u"]).loop
    'open'
    >>> fed = u - 0.5 * np.concatenate([[0.0], e[:-1]])
    >>> find_feedback([fed[None]], [y[None]], ["u"]).loop
    'closed'
    """
    if repeats:
        return FeedbackTest("open", "repeats")
    moves = np.any([np.ptp(rows, axis=1) > 0.0 for rows in inputs], axis=0)
    if not np.any(moves):
        return FeedbackTest("open", "repeats")
    whole = [rows[moves] for rows in (unthinned[0] if unthinned else inputs)]
    inputs, names = [rows[moves] for rows in inputs], tuple(np.asarray(names)[moves].tolist())
    n_in, n_out = len(names), len(outputs[0])
    order = min(LARGEST_ORDER, usable_order(inputs, n_out))
    pairs = [(u, y) for u, y in zip(inputs, outputs, strict=True) if _room(u, order) > 0]
    free = sum(_room(u, order) for u, _ in pairs) - n_in * order - LAGS * n_out
    if order < 1 or free < FEWEST_FREE:
        return FeedbackTest("unknown", "too short")
    noise = _noise(pairs, order)
    power = sum(np.sum(y**2, axis=1) for _, y in pairs)
    noisy = sum(np.sum(e**2, axis=1) for e in noise) > SMALLEST_NOISE * power
    past_noise = FeedbackTest("open", "no noise")
    if np.any(noisy):
        past_noise = _worst(_shares(pairs, [e[noisy] for e in noise], order), names, "test")
    if past_noise.p_value is not None and past_noise.p_value < LEVEL:
        return replace(past_noise, loop="closed")
    own = list(zip(whole, unthinned[1] if unthinned else outputs, strict=True))
    at_once = _worst(_shares_at_once(own, order), names, "same sample")
    if at_once.p_value is not None and at_once.p_value < LEVEL:
        return replace(at_once, loop="unknown")
    return past_noise


def _worst(found: Sequence[tuple[float, float]], names: Sequence[str], source: str) -> FeedbackTest:
    """The input that outputs move most surely, its probability that of so many inputs."""
    place = int(np.argmin([p for _, p in found]))
    share, p_value = found[place]
    return FeedbackTest("open", source, min(1.0, len(names) * p_value), names[place], share)


def usable_order(inputs: Sequence[Array], n_out: int) -> int:
    """Past samples of every channel that all records together allow."""
    return sum(int(u.shape[1]) for u in inputs) // (SAMPLES_PER_NUMBER * (len(inputs[0]) + n_out))


def _room(inputs: Array, order: int) -> int:
    return int(inputs.shape[1]) - order - LAGS


def past(rows: Array, first: int, lags: range) -> Array:
    """Columns of past samples of each row from sample `first` on, (n − first, rows · lags)."""
    n = rows.shape[1]
    return np.concatenate([rows[:, first - lag : n - lag] for lag in lags]).T


def _noise(pairs: Sequence[tuple[Array, Array]], order: int) -> list[Array]:
    """What a long ARX model leaves of the outputs of each record, (n_out, n − order)."""
    own, now = range(1, order + 1), range(order + 1)
    known = np.vstack([np.hstack([past(y, order, own), past(u, order, now)]) for u, y in pairs])
    left = _left(known, np.vstack([y[:, order:].T for _, y in pairs]))
    cuts = np.cumsum([y.shape[1] - order for _, y in pairs])[:-1]
    return [part.T for part in np.split(left, cuts)]


def _shares(
    pairs: Sequence[tuple[Array, Array]], noise: Sequence[Array], order: int
) -> list[tuple[float, float]]:
    """By input: share of what its past leaves that past noise explains, and its F probability."""
    own = np.vstack([past(u, order + LAGS, range(1, order + 1)) for u, _ in pairs])
    moved = np.vstack([past(e, LAGS, range(1, LAGS + 1)) for e in noise])
    targets = np.vstack([u[:, order + LAGS :].T for u, _ in pairs])
    left = _left(own, np.hstack([targets, moved]))
    n_in, n_moved = targets.shape[1], moved.shape[1]
    fresh, moved = left[:, :n_in], left[:, n_in:]
    rest = _left(moved, fresh)
    free = len(own) - own.shape[1] - n_moved
    tiny = np.finfo(float).tiny
    found = []
    for k in range(n_in):
        whole = max(float(fresh[:, k] @ fresh[:, k]), tiny)
        share = max(0.0, 1.0 - float(rest[:, k] @ rest[:, k]) / whole)
        f = share / n_moved / max((1.0 - share) / free, tiny)
        found.append((share, float(scipy.special.fdtrc(n_moved, free, f))))
    return found


def _shares_at_once(pairs: Sequence[tuple[Array, Array]], order: int) -> list[tuple[float, float]]:
    """By input: share of what its past leaves that outputs up to its sample explain, and F's p.

    The probability is that of the outputs of the same sample alone.
    """
    lags = range(1, order + 1)
    pairs = [pair for pair in pairs if pair[0].shape[1] > order]
    own = np.vstack([past(u, order, lags) for u, _ in pairs])
    both = np.hstack([own, np.vstack([past(y, order, lags) for _, y in pairs])])
    now_in, now_out = (np.vstack([rows[k][:, order:].T for rows in pairs]) for k in (0, 1))
    n_in = now_in.shape[1]
    fresh = np.sum(_left(own, now_in) ** 2, axis=0)
    left = _left(both, np.hstack([now_in, now_out]))
    seen = np.sum(left[:, n_in:] ** 2, axis=0) > SMALLEST_NOISE * np.sum(now_out**2, axis=0)
    before, now = left[:, :n_in], left[:, n_in:][:, seen]
    free = len(own) - both.shape[1] - now.shape[1]
    if free < FEWEST_FREE or not now.shape[1]:
        return [(0.0, 1.0)] * n_in
    rest = np.sum(_left(now, before) ** 2, axis=0)
    gain = np.sum(before**2, axis=0) - rest
    tiny = np.finfo(float).tiny
    f = np.maximum(gain, 0.0) / now.shape[1] / np.maximum(rest / free, tiny)
    is_new = fresh > SMALLEST_NOISE * np.sum(now_in**2, axis=0)
    chance = np.where(is_new, scipy.special.fdtrc(now.shape[1], free, f), 1.0)
    shares = np.maximum(0.0, 1.0 - rest / np.maximum(fresh, tiny))
    return list(zip(shares.tolist(), chance.tolist(), strict=True))


def _left(known: Array, targets: Array) -> Array:
    """What least squares on the known columns leave of the targets."""
    size = np.maximum(np.sqrt(np.sum(known**2, axis=0)), np.finfo(float).tiny)
    columns = known / size
    products = columns.T @ columns
    products.flat[:: columns.shape[1] + 1] += RIDGE
    factor = scipy.linalg.cho_factor(products, overwrite_a=True)
    weights = scipy.linalg.cho_solve(factor, columns.T @ targets)
    return np.asarray(targets - columns @ weights)
