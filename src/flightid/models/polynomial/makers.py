"""The named structures: ARX, ARMAX, output error, Box-Jenkins and the general form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

from flightid.models.polynomial.structure import (
    PolynomialOptions,
    PolynomialStructure,
    per_input,
)

Orders = int | Sequence[int]


class StructureMakers:
    """Structures for `identify`, as methods of `PolynomialModel`."""

    @staticmethod
    def general(
        inputs: str | Sequence[str],
        outputs: str,
        *,
        na: int = 0,
        nb: Orders = 0,
        nc: int = 0,
        nd: int = 0,
        nf: Orders = 0,
        nk: Orders = 1,
        **options: Unpack[PolynomialOptions],
    ) -> PolynomialStructure:
        """Structure of the general form for `identify`; `PolynomialStructure` says the options.

        Parameters
        ----------
        outputs : str
        inputs : str or sequence of str
        na, nb, nc, nd, nf, nk : int, or for nb, nf, nk a sequence with one for each input
            Orders; nb counts coefficients, nk samples of delay.
        **options
            ``initial_state``, ``offsets``, ``starts``, …
        """
        names = (inputs,) if isinstance(inputs, str) else tuple(inputs)
        n = len(names)
        b, f, k = per_input(nb, n), per_input(nf, n), per_input(nk, n)
        return PolynomialStructure(names, outputs, na, b, nc, nd, f, k, **options)

    @staticmethod
    def arx(
        inputs: str | Sequence[str],
        outputs: str,
        *,
        na: int,
        nb: Orders,
        nk: Orders = 1,
        **options: Unpack[PolynomialOptions],
    ) -> PolynomialStructure:
        """Structure A y = B u + e."""
        return StructureMakers.general(inputs, outputs, na=na, nb=nb, nk=nk, **options)

    @staticmethod
    def armax(
        inputs: str | Sequence[str],
        outputs: str,
        *,
        na: int,
        nb: Orders,
        nc: int,
        nk: Orders = 1,
        **options: Unpack[PolynomialOptions],
    ) -> PolynomialStructure:
        """Structure A y = B u + C e."""
        return StructureMakers.general(inputs, outputs, na=na, nb=nb, nc=nc, nk=nk, **options)

    @staticmethod
    def oe(
        inputs: str | Sequence[str],
        outputs: str,
        *,
        nb: Orders,
        nf: Orders,
        nk: Orders = 1,
        **options: Unpack[PolynomialOptions],
    ) -> PolynomialStructure:
        """Structure y = (B/F) u + e."""
        return StructureMakers.general(inputs, outputs, nb=nb, nf=nf, nk=nk, **options)

    @staticmethod
    def bj(
        inputs: str | Sequence[str],
        outputs: str,
        *,
        nb: Orders,
        nc: int,
        nd: int,
        nf: Orders,
        nk: Orders = 1,
        **options: Unpack[PolynomialOptions],
    ) -> PolynomialStructure:
        """Structure y = (B/F) u + (C/D) e."""
        return StructureMakers.general(
            inputs, outputs, nb=nb, nc=nc, nd=nd, nf=nf, nk=nk, **options
        )
