"""Files that a common tool has compressed, unpacked while they are read, and never beyond a bound. Light.

A file that unpacks to thousands of times its size is no log: what is unpacked stays below a multiple of the file, and
below a size for all files.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any, BinaryIO

from sccal.errors import DataError
from sccal.logs.limits import UNPACKED_FREE_BYTES, UNPACKED_LIMIT_BYTES, UNPACKED_RATIO, UNPACKING_MEMORY_BYTES

PIECE_BYTES = 1 << 20


def _gzip(file: BinaryIO) -> Iterator[bytes]:
    import gzip

    with gzip.open(file) as unpacked:
        yield from iter(lambda: unpacked.read(PIECE_BYTES), b"")


def _bzip2(file: BinaryIO) -> Iterator[bytes]:
    import bz2

    return _one_after_the_other(file, bz2.BZ2Decompressor)


def _xz(file: BinaryIO) -> Iterator[bytes]:
    import lzma

    return _one_after_the_other(file, lambda: lzma.LZMADecompressor(memlimit=UNPACKING_MEMORY_BYTES))


def _one_after_the_other(file: BinaryIO, new: Callable[[], Any]) -> Iterator[bytes]:
    """What the streams of a file hold, of which there may be several, with zeros between."""
    data = file.read(PIECE_BYTES)
    while data:
        decoder = new()
        while not decoder.eof:
            if decoder.needs_input and not data:
                data = file.read(PIECE_BYTES)
                if not data:
                    raise EOFError("it ends in the middle")
            piece, data = decoder.decompress(data, PIECE_BYTES), b""
            if piece:
                yield piece
        data = decoder.unused_data.lstrip(b"\0") or file.read(PIECE_BYTES).lstrip(b"\0")


def _zstandard(file: BinaryIO) -> Iterator[bytes]:
    import zstandard

    begin = file.read(_ZSTANDARD_HEAD_BYTES)
    file.seek(0)
    told = zstandard.get_frame_parameters(begin).content_size
    size = 0
    decoder = zstandard.ZstdDecompressor(max_window_size=UNPACKING_MEMORY_BYTES // 2)
    with decoder.stream_reader(file, read_across_frames=True, closefd=False) as unpacked:
        for piece in iter(lambda: unpacked.read(PIECE_BYTES), b""):
            size += len(piece)
            yield piece
    if told != zstandard.CONTENTSIZE_UNKNOWN and size < told:
        raise EOFError(f"it ends in the middle: {told} bytes are announced")


_ZSTANDARD_HEAD_BYTES = 18
_UNPACK: dict[str, Callable[[BinaryIO], Iterator[bytes]]] = {
    ".gz": _gzip,
    ".bz2": _bzip2,
    ".xz": _xz,
    ".zst": _zstandard,
    ".zstd": _zstandard,
}
_TOOLS = {".gz": "gunzip", ".bz2": "bunzip2", ".xz": "unxz", ".zst": "zstd -d", ".zstd": "zstd -d"}


def is_packed(name: str | PurePath) -> bool:
    """Whether a file's name says that it is compressed."""
    return PurePath(name).suffix.lower() in _UNPACK


def plain_name(name: str) -> str:
    """A file's name without the ending that says that it is compressed."""
    return name[: -len(PurePath(name).suffix)] if is_packed(name) else name


def tool_for(path: PurePath) -> str:
    """The command that unpacks a file."""
    return f"{_TOOLS[path.suffix.lower()]} {path.name}"


def most_bytes(packed_bytes: int) -> int:
    """How many bytes a compressed file of so many may unpack to."""
    return min(UNPACKED_LIMIT_BYTES, UNPACKED_FREE_BYTES + UNPACKED_RATIO * packed_bytes)


def pieces_of(path: Path) -> Iterator[bytes]:
    """A file's bytes in pieces of PIECE_BYTES at most, unpacked where it is compressed.

    Raises:
        DataError: it cannot be read or unpacked, or unpacks to more than any log.
    """
    try:
        with path.open("rb") as file:
            if is_packed(path):
                yield from _unpacked(path, file)
            else:
                yield from iter(lambda: file.read(PIECE_BYTES), b"")
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error


def _unpacked(path: Path, file: BinaryIO) -> Iterator[bytes]:
    packed_bytes = path.stat().st_size
    most, size = most_bytes(packed_bytes), 0
    pieces = _UNPACK[path.suffix.lower()](file)
    while True:
        try:
            piece = next(pieces, b"")
        except Exception as error:  # whatever the libraries make of broken bytes
            why = " ".join(str(error).split())[:200] or type(error).__name__
            raise DataError(
                f"{path}: cannot be unpacked beyond its first {size} bytes ({why}): it was cut or damaged; copy it "
                f"again, or try `{tool_for(path)}`"
            ) from error
        if not piece:
            return
        size += len(piece)
        if size > most:
            raise DataError(
                f"{path}: its {packed_bytes} bytes unpack to more than {most} bytes, more than a log should "
                f"({UNPACKED_RATIO} times its size and {UNPACKED_FREE_BYTES >> 20} MiB, at most "
                f"{UNPACKED_LIMIT_BYTES >> 30} GiB); if it is one, unpack it first: `{tool_for(path)}`"
            )
        yield piece


def bytes_of(path: Path) -> bytes:
    """All bytes of a file, unpacked where it is compressed.

    Raises:
        DataError: as pieces_of.
    """
    if is_packed(path):
        return b"".join(pieces_of(path))
    try:
        return path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error


def head_of(path: Path, size: int) -> bytes:
    """The first bytes of a file, unpacked where it is compressed; no more of it is read than the first piece.

    Raises:
        DataError: as pieces_of.
    """
    return next(pieces_of(path), b"")[:size]


@contextmanager
def plain_file(path: Path) -> Iterator[Path]:
    """A file as it is, or where it is compressed a temporary one that holds what it unpacks to.

    Raises:
        DataError: as pieces_of, with the name of the file itself in whatever is raised inside.
    """
    if not is_packed(path):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="unpacked-") as folder:
        plain = Path(folder) / plain_name(path.name)
        try:
            with plain.open("wb") as file:
                for piece in pieces_of(path):
                    file.write(piece)
        except OSError as error:
            raise DataError(f"{path}: cannot be unpacked into {folder} ({error.strerror or error})") from error
        try:
            yield plain
        except DataError as error:
            raise DataError(str(error).replace(str(plain), str(path))) from error
