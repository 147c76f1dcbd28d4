"""What a record holds, in a few characters: whether another is the same, or a part of it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.record.record import Record

SPAN = 16
"""Samples of one mark: so many equal ones in a row are no chance in a measured channel."""
MARKS = 64
"""Fewest marks of a channel that has as many spans: of a short one all are kept."""
SPACING = 25
"""Samples of a mark, on average: a piece of 250 holds some ten."""
MOST_MARKS = 512
"""Of a channel, 8 kB in a file."""
TRAINING = "training_records"
"""Where the provenance of a fit keeps digests of its records."""
FEWEST = 3
"""Marks in common that say that samples are the same."""


@dataclass(frozen=True)
class RecordDigest:
    """Of one record: what its samples hash to, and marks that a part of it shares.

    Attributes
    ----------
    name : str
        Of the record.
    start_s, end_s : float
        First and last stamp, s.
    sha256 : str
        See `record_sha256`.
    marks : mapping of str to str
        By channel: the smallest hashes of its spans of `SPAN` samples, one of `SPACING` but from
        `MARKS` to `MOST_MARKS`, 16 hexadecimal digits each. A span that stands still makes none.

    Example
    -------
    >>> time_s = np.arange(400) * 0.1
    >>> noise = np.random.default_rng(1).standard_normal(400)
    >>> flown = Record.from_arrays(time_s, outputs={"p": noise})
    >>> digest_of(flown, ["p"]).shared(flown.segment(10.0, 25.0), ["p"])
    1.0
    """

    name: str
    start_s: float
    end_s: float
    sha256: str
    marks: Mapping[str, str]

    def shared(self, record: Record, names: Iterable[str]) -> float:
        """Share of a record's samples that are samples of this one; 0 where it cannot be told.

        Of the channels in common the one that shares least: an input flown twice is no record
        flown twice.

        Parameters
        ----------
        record : Record
        names : iterable of str
            Channels to compare.
        """
        known = [name for name in names if name in self.marks and name in record]
        if known and record_sha256(record, self.marks) == self.sha256:
            return 1.0
        shares = [_share(self.marks[name], record[name]) for name in known]
        return min((share for share in shares if share is not None), default=0.0)

    def overlaps(self, other: RecordDigest) -> bool:
        """Whether both hold samples of one record, in every channel that both hold."""
        names = self.marks.keys() & other.marks.keys()
        pairs = [(_numbers(self.marks[name]), _numbers(other.marks[name])) for name in names]
        common = [np.intersect1d(*pair).size for pair in pairs]
        return self.sha256 == other.sha256 or min(common, default=0) >= FEWEST

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> RecordDigest:
        """From plain values; DataError where they are no digest, as in a file changed by hand."""
        try:
            marks = {str(name): str(text) for name, text in dict(values["marks"]).items()}
            for text in marks.values():
                _numbers(text)
            span = float(values["start_s"]), float(values["end_s"])
            return cls(str(values["name"]), *span, str(values["sha256"]), marks)
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(
                "these values are no digest of a record",
                found=f"{type(error).__name__}: {error}"[:200],
                needed="what the fit wrote under training_records",
                action="take training_records out of the file",
            ) from error


class RecordDigests(Sequence[RecordDigest]):
    """Digests of several records, made when one of them is asked for: few who estimate need any.

    Parameters
    ----------
    records : sequence of Record
        Kept until then.
    names : sequence of str
        Channels.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.1], outputs={"p": [1.0, 2.0]})
    >>> RecordDigests([record], ["p"])[0] == digest_of(record, ["p"])
    True
    """

    def __init__(self, records: Sequence[Record], names: Sequence[str]) -> None:
        self._records, self._names = tuple(records), tuple(names)
        self._found: tuple[RecordDigest, ...] | None = None

    def _made(self) -> tuple[RecordDigest, ...]:
        found = self._found
        if found is None:
            found = self._found = tuple(digest_of(each, self._names) for each in self._records)
            self._records = ()
        return found

    def __len__(self) -> int:
        return len(self._made())

    @overload
    def __getitem__(self, place: int) -> RecordDigest: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[RecordDigest, ...]: ...
    def __getitem__(self, place: int | slice) -> RecordDigest | tuple[RecordDigest, ...]:
        return self._made()[place]

    def __reduce__(self) -> tuple[type[tuple[RecordDigest, ...]], tuple[object, ...]]:
        """Elsewhere they are a tuple, without the records."""
        return tuple, (self._made(),)


def record_sha256(record: Record, names: Iterable[str] | None = None) -> str:
    """Hash of what a record holds: stamps, and name, unit and samples of its channels.

    Not of where it came from: a record and its copy in a file have the same.

    Parameters
    ----------
    record : Record
    names : iterable of str, optional
        Channels to count, in any order; those that it lacks do not count. Default: all.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.1], outputs={"p": [1.0, 2.0]})
    >>> record_sha256(record) == record_sha256(record.replace(name="copy"))
    True
    """
    digest = hashlib.sha256(np.ascontiguousarray(record.time_s).tobytes())
    held = {*record.channels}
    for name in sorted(held if names is None else held & {*names}):
        digest.update(f"\0{name}\0{record.unit(name)}\0".encode())
        digest.update(np.ascontiguousarray(record[name]).tobytes())
    return digest.hexdigest()


def digest_of(record: Record, names: Iterable[str]) -> RecordDigest:
    """Digest of the named channels of a record; those that it lacks are left out."""
    held = [name for name in names if name in record]
    return record.once(("digest", *held), lambda: _digested(record, held))


def _digested(record: Record, held: Sequence[str]) -> RecordDigest:
    marks = {name: _smallest(_hashes(record[name])) for name in held}
    return RecordDigest(
        record.name,
        float(record.time_s[0]),
        float(record.time_s[-1]),
        record_sha256(record, held),
        {name: found.astype(">u8").tobytes().hex() for name, found in marks.items()},
    )


def _hashes(samples: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Hashes of all spans that move: of samples, of pairs, of fours, to spans of `SPAN`."""
    return _native.span_hashes(samples, SPAN)


def _smallest(found: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The smallest of some hashes, in order, each once: so many that a short piece holds a few."""
    kept = min(max(MARKS, found.size // SPACING), MOST_MARKS)
    # Hashes are spread evenly: of this share of their range about four times as many are left.
    share = 4 * kept / max(found.size, 1)
    if share < 1.0:
        few = np.unique(found[found < np.uint64(share * 2.0**64)])
        if few.size >= kept:
            return few[:kept]
    return np.unique(found)[:kept]


def _numbers(text: str) -> NDArray[np.uint64]:
    return np.frombuffer(bytes.fromhex(text), ">u8").astype(np.uint64)


def _share(text: str, samples: NDArray[np.float64]) -> float | None:
    """Share of a channel's spans that are among the marks, of those that could be.

    A record with fewer marks than `MARKS` has shown all of its spans.
    """
    marks = _numbers(text)
    if marks.size < FEWEST:
        return None
    found = _hashes(samples)
    seen = np.unique(found if marks.size < MARKS else found[found <= marks[-1]])
    common = int(np.isin(seen, marks).sum())
    return common / seen.size if common >= FEWEST else 0.0
