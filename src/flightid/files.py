"""Files: written whole or not at all, and known by their SHA-256."""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import time
from collections.abc import Callable
from pathlib import Path

from flightid.errors import OptionError

BLOCK_BYTES = 1 << 20
STALE_S = 3600.0


def as_path(path: object) -> Path:
    """The path that a writer was given, for writers that take what to write first.

    Raises
    ------
    OptionError
        It is no path: the two arguments stand the wrong way round.
    """
    if isinstance(path, str | os.PathLike):
        return Path(path)
    raise OptionError(
        "the file to write was expected here",
        found=type(path).__name__,
        needed="a path",
        action="give what is to be written first, then the path",
    )


def write_atomically(path: str | Path, content: bytes | str | Callable[[Path], object]) -> Path:
    """Write a file so that a reader sees the old content or the whole new one, never a part.

    The content goes to a temporary name in the same folder, is flushed to the disk, and is then
    renamed. On any failure or interrupt the temporary file is removed and `path` is untouched.

    Parameters
    ----------
    path : str or Path
        File to write; its folder must exist.
    content : bytes, str or callable
        Bytes; text, written as UTF-8; or a function that writes to the path it is given (the
        temporary name, with the same suffix).

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    OSError
        The folder is missing or cannot be written.

    Example
    -------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = write_atomically(Path(folder) / "result.json", "{}")
    ...     written.read_text(), [entry.name for entry in Path(folder).iterdir()]
    ('{}', ['result.json'])
    """
    final = as_path(path)
    _remove_stale(final)
    # The suffix stays last: writers of other libraries choose their format by it.
    temporary = final.with_name(f".{final.stem}.{secrets.token_hex(6)}.part{final.suffix}")
    try:
        if callable(content):
            content(temporary)
        else:
            temporary.write_bytes(content.encode() if isinstance(content, str) else content)
        # Power may go at any line. The bytes reach the disk before the name does: a journal may
        # write the rename first, and `path` would then name an empty file. After the rename the
        # folder is flushed, so that who is told "written" finds it after the next start.
        flush(temporary)
        temporary.replace(final)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    flush(final.parent)
    return final


def sha256_of_file(path: str | Path) -> str:
    """SHA-256 of a file's bytes, read in blocks; of a folder, of the digests of its files by name.

    Parameters
    ----------
    path : str or Path
        File or folder to read.

    Returns
    -------
    str
        64 hexadecimal digits.

    Raises
    ------
    OSError
        The file cannot be read.

    Example
    -------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sha256_of_file(write_atomically(Path(folder) / "empty", b""))[:16]
    'e3b0c44298fc1c14'
    """
    digest, path = hashlib.sha256(), Path(path)
    if path.is_dir():
        for each in sorted(each for each in path.iterdir() if each.is_file()):
            digest.update(sha256_of_file(each).encode())
        return digest.hexdigest()
    with path.open("rb") as stream:
        while block := stream.read(BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


def _remove_stale(final: Path) -> None:
    """Remove what killed writers of the same file left; a living one takes less than an hour."""
    pattern = re.compile(
        rf"\.{re.escape(final.stem)}\.[0-9a-f]{{12}}\.part{re.escape(final.suffix)}"
    )
    try:
        for entry in os.scandir(final.parent):
            is_ours = pattern.fullmatch(entry.name) and entry.is_file(follow_symlinks=False)
            if is_ours and time.time() - entry.stat(follow_symlinks=False).st_mtime > STALE_S:
                Path(entry.path).unlink(missing_ok=True)
    except OSError:
        return  # What cannot be tidied stays; the writing itself says what is wrong.


def flush(path: Path) -> None:
    """Bring a file, or the names in a folder, to the disk."""
    if path.is_dir() and os.name == "nt":
        return  # Windows has no handle for a folder; its rename is durable by itself.
    handle = os.open(path, os.O_RDONLY if path.is_dir() or os.name != "nt" else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def process_lives(process: int) -> bool:
    """Whether a process of this machine lives, one of another user too.

    On Windows a signal 0 would end it: there every process is taken for living.

    Example
    -------
    >>> process_lives(os.getpid())
    True
    """
    if os.name == "nt":
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True
