"""Which structure a study takes of those that it tried."""

from __future__ import annotations

import numpy as np
from scipy import signal

import flightid as fid
from flightid.study.structure_settings import StructureSettings
from flightid.study.structures import fit_structure, ranked

T_S = 0.02


def rig() -> fid.Record:
    """A second-order rig by SciPy, white noise on its output; its input ends away from its mean."""
    rng = np.random.default_rng(1)
    u = np.repeat(np.sign(rng.standard_normal(300)), 10) * 0.5
    (b, a, _) = signal.cont2discrete(([64.0], [1.0, 8.0, 64.0]), T_S)
    y = signal.lfilter(b.ravel(), a, u) + 0.01 * rng.standard_normal(len(u))
    return fid.Record.from_arrays(
        np.arange(len(u)) * T_S, inputs={"u": u}, outputs={"y": y}, hold="zero"
    )


def test_an_offset_of_the_means_asks_for_no_pole() -> None:
    whole = rig()
    flown, unseen = whole.segment(0.0, 29.99), whole.segment(29.99, 44.98)
    orders = {"nb": (2, 3), "nf": (2, 3), "nk": (1,)}
    settings = StructureSettings("oe", ("u",), ("y",), (), (), orders)
    fit, scan = fit_structure(settings, ("u",), [flown], [unseen])
    first = ranked(scan, "balanced")[0]
    assert (first.structure.nb, first.structure.nf) == ((2,), (2,))
    assert (fit.structure.nb, fit.structure.nf) == ((2,), (2,))
