"""Blocks of a digital controller: recursions that stand for continuous blocks."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from flightid.control.loops.block import Block
from flightid.errors import ModelError, OptionError
from flightid.models.linear.linear_system import LinearSystem


def sampled(
    block: Block,
    sample_time_s: float,
    hold: Literal["tustin", "zero", "first"] = "tustin",
    *,
    prewarp_rad_s: float | None = None,
) -> Block:
    """The recursion that stands for a continuous block in a digital controller.

    Parameters
    ----------
    block : Block
        Linear and continuous.
    sample_time_s : float
        T, s.
    hold : {"tustin", "zero", "first"}
        Trapezoidal rule; or exact for inputs that are steps or straight lines between samples.
    prewarp_rad_s : float, optional
        Where the trapezoidal rule keeps the response exactly, rad/s.

    Raises
    ------
    ModelError
        The block is not linear, or sampled already.
    OptionError
        An unknown method, or a frequency to keep that is not between zero and half the rate.

    Reference
    ---------
    Franklin, Powell & Workman, *Digital Control of Dynamic Systems*, 3rd ed., section 6.1.

    Example
    -------
    >>> import flightid as fid
    >>> print(sampled(fid.loops.low_pass("p", "p_slow", 20.0), 0.01))
    1 state, every 0.01 s
    """
    part = block.part
    if not isinstance(part, LinearSystem) or part.is_discrete:
        raise ModelError("this block cannot be sampled", found=f"{block!r}: {block}",
                         needed="a linear continuous block")  # fmt: skip
    if hold not in ("tustin", "zero", "first"):
        raise OptionError("the method is not known", found=hold, needed="tustin, zero or first")
    if hold != "tustin":
        return replace(block, part=part.sampled(sample_time_s, hold))
    step = sample_time_s
    if prewarp_rad_s is not None:
        if not 0.0 < prewarp_rad_s < np.pi / sample_time_s:
            raise OptionError("the frequency to keep", found=f"{prewarp_rad_s} rad/s",
                              needed="between zero and half the sample rate")  # fmt: skip
        step = 2.0 * np.tan(prewarp_rad_s * sample_time_s / 2.0) / prewarp_rad_s
    a, b, c, d, delays = part.state_space()
    half = 0.5 * step * a
    left = np.linalg.inv(np.eye(part.order) - half)
    recursion = replace(
        part,
        a=left @ (np.eye(part.order) + half),
        b=step * left @ b,
        c=c @ left,
        d=d + 0.5 * step * c @ left @ b,
        delays_s=delays,
        sample_time_s=sample_time_s,
    )
    return replace(block, part=recursion)
