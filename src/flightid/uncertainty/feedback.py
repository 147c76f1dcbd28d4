"""One test of whether a loop is closed around a vehicle: does past noise move an input.

An open loop leaves an input independent of the noise of the outputs. The noise is what a long ARX
model of the outputs leaves: it knows light damping by few numbers, where a pulse response of as
many lags has not died out. What is new in an input is what its own past does not foretell. Past
noise that explains a share of what is new says that a loop is closed. Either of the two being white
is enough for the F distribution, so neither a poor model of the outputs nor a held, swept or
two-level input raises false alarms; where a loop is seen, an input's past is taken out of it once
more, with weights that change as a sweep's frequency does (`moving_past.py`). An input that repeats
exactly cannot hold any noise.

A controller that answers within the sample hides its noise: the model of the outputs takes u(t) for
their cause. So what is new in an input is also held against the outputs of its own sample. Where
they go together, a vehicle that answers at once and a controller that does look the same, and the
loop is not known. Nor is it where noise in the measurement of an input would make outputs foretell
it as they do (`noisy_input.py`). Where no loop is seen, what could have been is told
(`feedback_power.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.feedback_power import unseen_feedback
from flightid.uncertainty.feedback_result import LAGS, LEVEL, FeedbackTest
from flightid.uncertainty.lagged_products import (
    RIDGE,
    explained,
    lagged_products,
    left_by_past,
    products_with_past,
    weights_of,
)
from flightid.uncertainty.moving_past import moving_chance
from flightid.uncertainty.noisy_input import explaining_noise

Array = NDArray[np.float64]
Pair = tuple[Array, Array]
LARGEST_ORDER = 20
"""Past samples of every channel in the model of the outputs, and of an input in that of its own."""
MAXIMUM_SAMPLES = 20_000
"""Of all records together that a test looks at."""
PAST = range(1, LAGS + 1)
"""Samples before an input's that may move it."""
SAMPLES_PER_NUMBER = 10
"""Samples for each number of a model."""
FEWEST_FREE = 30
"""Degrees of freedom without which nothing is tested."""
SMALLEST_NOISE = 1e-8
"""Share of an output's power below which its noise is rounding, or cannot bias anything."""
SMALLEST_NEWS = 10.0 * RIDGE
"""Share of an input's power below which what is new in it is what the ridge leaves of its past."""


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
    pasts = _Pasts([np.concatenate(pair) for pair in pairs], order, n_in)
    noise = _noise(pairs, pasts.news, n_in)
    power = sum(np.sum(y**2, axis=1) for _, y in pairs)
    noisy = sum(np.sum(e**2, axis=1) for e in noise) > SMALLEST_NOISE * power
    past_noise = FeedbackTest("open", "no noise")
    if np.any(noisy):
        heard = [e[noisy] for e in noise]
        shares = _moving(_shares(pairs, heard, order), pairs, heard, order, PAST)
        past_noise = _worst(shares, names, "test")
        echo = pasts.weights[:, n_in:, n_in:].transpose(0, 2, 1)[:, noisy][:, :, noisy]
        if past_noise.p_value is not None and past_noise.p_value < LEVEL:
            return _unless_noisy(shares, [(u, y[noisy]) for u, y in pairs], order, names)
        past_noise = _with_power(past_noise, pasts, heard, echo, names)
    if unthinned:
        pairs = [(u, y) for u, y in zip(whole, unthinned[1], strict=True) if u.shape[1] > order]
        pasts = _Pasts([np.concatenate(pair) for pair in pairs], order, n_in)
    outputs_news = [new[n_in:] for new in pasts.news]
    shares = _moving(_shares_at_once(pasts), pairs, outputs_news, order, range(1))
    at_once = _worst(shares, names, "same sample")
    if at_once.p_value is not None and at_once.p_value < LEVEL:
        return replace(at_once, loop="unknown")
    return past_noise


@dataclass(frozen=True, eq=False)
class _Pasts:
    """Channels of some records, inputs first, and what their pasts make of them: worked out once.

    Attributes
    ----------
    records : sequence of ndarray, each shape (n_channels, n_samples)
    order : int
        Past samples.
    n_in : int
        Inputs among the channels.
    """

    records: Sequence[Array]
    order: int
    n_in: int

    @cached_property
    def _products(self) -> Array:
        return lagged_products(self.records, self.order, self.order)

    @cached_property
    def weights(self) -> Array:
        """What the pasts of all channels make of each, (order, n_channels, n_channels)."""
        return _past_weights(self._products)

    @cached_property
    def news(self) -> list[Array]:
        """What these leave, (n_channels, n − order)."""
        return left_by_past(self.records, self.weights)

    @cached_property
    def own(self) -> Array:
        """What the pasts of inputs make of inputs, (order, n_in, n_in)."""
        return _past_weights(self._products[:, : self.n_in, :, : self.n_in])

    @cached_property
    def inputs(self) -> list[Array]:
        """The inputs of each record."""
        return [rows[: self.n_in] for rows in self.records]

    @cached_property
    def fresh(self) -> list[Array]:
        """What the pasts of inputs leave of them, (n_in, n − order)."""
        return left_by_past(self.inputs, self.own)


def _worst(found: Sequence[tuple[float, float]], names: Sequence[str], source: str) -> FeedbackTest:
    """The input that outputs move most surely, its probability that of so many inputs."""
    place = int(np.argmin([p for _, p in found]))
    share, p_value = found[place]
    return FeedbackTest("open", source, min(1.0, len(names) * p_value), names[place], share)


def _with_power(
    test: FeedbackTest, pasts: _Pasts, noise: Sequence[Array], echo: Array, names: Sequence[str]
) -> FeedbackTest:
    """A test that saw no loop, with the largest one that it would have missed."""
    unseen = unseen_feedback(noise, echo, pasts.inputs, pasts.own, pasts.fresh)
    if unseen is None:
        return test
    named = names[unseen.input]
    return replace(test, input=named, unseen_share=unseen.share, unseen_bias=unseen.bias)


def _unless_noisy(
    found: Sequence[tuple[float, float]], pairs: Sequence[Pair], order: int, names: Sequence[str]
) -> FeedbackTest:
    """The surest input that looks fed back and that noise of its sensor does not explain.

    Where it explains all of them the loop is not known.
    """
    noises: dict[int, float] = {}
    for place in np.argsort([chance for _, chance in found]).tolist():
        share, chance = found[place]
        p_value = min(1.0, len(names) * chance)
        if p_value >= LEVEL:
            break
        noise = explaining_noise(pairs, place, order, LAGS)
        if noise is None:
            return FeedbackTest("closed", "test", p_value, names[place], share)
        noises[place] = noise
    first = next(iter(noises))
    known = _worst([found[first]], [names[first]], "noisy input")
    size = float(np.sqrt(noises[first]))
    p_value = min(1.0, len(names) * found[first][1])
    return replace(known, loop="unknown", p_value=p_value, input_noise=size)


def _moving(
    found: Sequence[tuple[float, float]],
    pairs: Sequence[Pair],
    noise: Sequence[Array],
    order: int,
    lags: range,
) -> list[tuple[float, float]]:
    """By input: share and probability, of those that look fed back also as if they were sweeps.

    The surest first, until one stays: that one is named.
    """
    judged = list(found)
    for place in np.argsort([chance for _, chance in found]).tolist():
        share, chance = found[place]
        if chance * len(found) >= LEVEL:
            break
        again = moving_chance(pairs, noise, place, order, lags, LEVEL / len(found))
        if again is None or again * len(found) < LEVEL:
            break
        judged[place] = share, max(again, chance)
    return judged


def usable_order(inputs: Sequence[Array], n_out: int) -> int:
    """Past samples of every channel that all records together allow."""
    return sum(int(u.shape[1]) for u in inputs) // (SAMPLES_PER_NUMBER * (len(inputs[0]) + n_out))


def _room(inputs: Array, order: int) -> int:
    return int(inputs.shape[1]) - order - LAGS


def _past_weights(products: Array) -> Array:
    """What the pasts of all channels make of each, by their lagged products."""
    lags, channels = products.shape[:2]
    known, targets = np.arange(channels, channels * lags), np.arange(channels)
    weights = weights_of(products.reshape(2 * (channels * lags,)), known, targets)
    return weights.reshape(lags - 1, channels, channels)


def _noise(pairs: Sequence[Pair], news: Sequence[Array], n_in: int) -> list[Array]:
    """What a long ARX model leaves of the outputs of each record, (n_out, n − order).

    Inputs of the same sample are taken out as news, for their pasts have been.
    """
    products = np.sum([new @ new.T for new in news], axis=0)
    power = np.sum([np.sum(u**2, axis=1) for u, _ in pairs], axis=0)
    ridge = np.diag(RIDGE * np.maximum(power, np.finfo(float).tiny))
    turn = np.linalg.solve(products[:n_in, :n_in] + ridge, products[:n_in, n_in:]).T
    return [new[n_in:] - turn @ new[:n_in] for new in news]


def _shares(pairs: Sequence[Pair], noise: Sequence[Array], order: int) -> list[tuple[float, float]]:
    """By input: share of what its past leaves that past noise explains, and its F probability.

    What a ridge leaves of a smooth input is as smooth: beside it no noise is white enough.
    """
    n_in, longest = len(pairs[0][0]), max(order, LAGS)
    padded = [np.pad(e, ((0, 0), (order, 0))) for e in noise]
    rows = [np.concatenate([u, e]) for (u, _), e in zip(pairs, padded, strict=True)]
    products = lagged_products(rows, order + LAGS, longest)
    places = np.arange((longest + 1) * len(rows[0])).reshape(longest + 1, -1)
    products = products.reshape(2 * (places.size,))
    own, moved = places[1 : order + 1, :n_in].ravel(), places[1 : LAGS + 1, n_in:].ravel()
    # The past of inputs, taken out of them sample by sample, out of past noise by products.
    weights = weights_of(products, own, np.append(places[0, :n_in], moved))
    of_inputs, of_noise = weights[:, :n_in].reshape(order, n_in, n_in), weights[:, n_in:]
    fresh = left_by_past([u[:, LAGS:] for u, _ in pairs], of_inputs)
    aims = products_with_past(fresh, rows, longest).reshape(places.size, n_in)
    cross = products[np.ix_(own, moved)].T @ of_noise
    among = products[np.ix_(moved, moved)] - cross - cross.T
    among += of_noise.T @ products[np.ix_(own, own)] @ of_noise
    free = sum(u.shape[1] - order - LAGS for u, _ in pairs) - own.size - moved.size
    tiny = np.finfo(float).tiny
    whole = np.maximum(np.sum([np.sum(new**2, axis=1) for new in fresh], axis=0), tiny)
    shares = explained(among, aims[moved] - of_noise.T @ aims[own]) / whole
    shares = np.clip(shares, 0.0, 1.0)
    f = shares / moved.size / np.maximum((1.0 - shares) / free, tiny)
    floor = SMALLEST_NEWS * sum(np.sum(u**2, axis=1) for u, _ in pairs)
    chances = np.where(whole > floor, scipy.special.fdtrc(moved.size, free, f), 1.0)
    return list(zip(shares.tolist(), chances.tolist(), strict=True))


def _shares_at_once(pasts: _Pasts) -> list[tuple[float, float]]:
    """By input: share of what its past leaves that outputs up to its sample explain, and F's p.

    The probability is that of the outputs of the same sample alone.
    """
    n_in, order, news = pasts.n_in, pasts.order, pasts.news
    power = [np.sum(rows[:, order:] ** 2, axis=1) for rows in pasts.records]
    floor = SMALLEST_NOISE * np.sum(power, axis=0)
    fresh = np.sum([np.sum(new**2, axis=1) for new in pasts.fresh], axis=0)
    products = np.sum([new @ new.T for new in news], axis=0)
    seen = n_in + np.flatnonzero(np.diagonal(products)[n_in:] > floor[n_in:])
    free = sum(new.shape[1] for new in news) - order * len(products) - seen.size
    if free < FEWEST_FREE or not seen.size:
        return [(0.0, 1.0)] * n_in
    way = weights_of(products, seen, np.arange(n_in)).T
    rest = np.sum([np.sum((new[:n_in] - way @ new[seen]) ** 2, axis=1) for new in news], axis=0)
    gain = np.diagonal(products)[:n_in] - rest
    tiny = np.finfo(float).tiny
    f = np.maximum(gain, 0.0) / seen.size / np.maximum(rest / free, tiny)
    chance = np.where(fresh > floor[:n_in], scipy.special.fdtrc(seen.size, free, f), 1.0)
    shares = np.maximum(0.0, 1.0 - rest / np.maximum(fresh, tiny))
    return list(zip(shares.tolist(), chance.tolist(), strict=True))
