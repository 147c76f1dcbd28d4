"""One damaged file at its reader, by seed."""

from __future__ import annotations

import tempfile
import warnings
from functools import cache
from pathlib import Path

import numpy as np

from flightid.errors import FlightidError
from tests.fuzz.mutations import damaged
from tests.fuzz.seeds import Seed, seeds

KEPT = Path(__file__).parent / "kept"
"""Files that once ended otherwise, as `READER~WHAT`: the reader's name comes first."""


@cache
def sound() -> dict[str, Seed]:
    """The seeds, made once."""
    with tempfile.TemporaryDirectory() as folder:
        return {seed.name: seed for seed in seeds(Path(folder))}


def made(seed: int) -> tuple[Seed, bytes]:
    """Reader and damaged content of a seed."""
    random = np.random.default_rng(seed)
    all_seeds = list(sound().values())
    chosen, other = (all_seeds[int(k)] for k in random.integers(len(all_seeds), size=2))
    return chosen, damaged(random, chosen.content, other.content, is_text=chosen.is_text)


def ended(chosen: Seed, content: bytes, folder: Path) -> str:
    """How a reader ended: "read" or "refused"; every other error is passed on."""
    path = folder / chosen.name
    path.write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            chosen.read(path)
    except FlightidError:
        return "refused"
    return "read"
