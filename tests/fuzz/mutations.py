"""Damage to bytes: what transmission, bad tools and bad people do."""

from __future__ import annotations

import numpy as np

Random = np.random.Generator
EXTREMES = (
    0,
    1,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    1 << 40,
    1 << 63,
)
WORDS = (
    b"[", b"]", b"{", b"}", b'"', b"'", b",", b";", b"\t", b"\n", b"\r\n", b"=", b".", b"-", b"#",
    b"nan", b"inf", b"1e999", b"-0", b"9" * 5000, b"0x" + b"f" * 600, b"[" * 5000, b"{a=" * 3000,
    b"\xff\xfe", b"\x00", b"\xef\xbb\xbf", b"a" * 70000, b"true", b"null", b"1979-05-27", b"[[x]]",
    b"\xe2\x80\xae", b"1,5", b"_", b"e", b" [deg/s]", b"time",
)  # fmt: skip


def damaged(random: Random, content: bytes, other: bytes, *, is_text: bool) -> bytes:
    """One to eight faults in a file; `other` lends parts of itself."""
    made = bytearray(content)
    for _ in range(int(random.integers(1, 9)) if random.random() < 0.5 else 1):
        _fault(random, made, other, is_text)
    return bytes(made)


def _fault(random: Random, made: bytearray, other: bytes, is_text: bool) -> None:
    at = int(random.integers(len(made) + 1))
    span = int(random.choice([1, 2, 4, 8, 64, 512]))
    kind = random.integers(8) if made else 7
    if kind == 0 and at < len(made):
        made[at] ^= 1 << int(random.integers(8))
    elif kind == 1 and at < len(made):
        made[at] = int(random.integers(256))
    elif kind == 2:
        width = int(random.choice([2, 4, 8]))
        value = int(random.choice(np.array(EXTREMES, dtype=np.uint64))) % (1 << (8 * width))
        made[at : at + width] = value.to_bytes(width, str(random.choice(["little", "big"])))  # type: ignore[arg-type]
    elif kind == 3:
        del made[at : at + span]
    elif kind == 4:
        made[at:at] = made[at : at + span]
    elif kind == 5 and other:
        start = int(random.integers(len(other)))
        made[at : at + span] = other[start : start + span]
    elif kind == 6 and random.random() < 0.3:
        del made[at:]
    elif is_text:
        made[at:at] = WORDS[int(random.integers(len(WORDS)))]
