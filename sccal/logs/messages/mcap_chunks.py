"""Decompressing one MCAP chunk, whole or cut, without believing the sizes that it claims."""

from __future__ import annotations

_BLIND_BYTES = 64 << 20
"""Claims up to this size are allocated at once."""
_STEP_BYTES = 8 << 20
_MOST_TIMES = 256
"""A larger chunk that claims to have been compressed by more than this (LZ4's limit) holds no log."""


class DamagedError(Exception):
    """The chunk cannot be decompressed; the message says why."""


def decompressed(raw: memoryview, compression: str, claimed: int, cut: bool) -> bytes:
    """The chunk's records; of a chunk that is ``cut``, as many bytes as are still there.

    Raises:
        DamagedError: unknown compression, broken data, or a size other than ``claimed``.
    """
    if not cut and claimed > max(_BLIND_BYTES, _MOST_TIMES * len(raw)):
        raise DamagedError(f"{len(raw)} bytes claim to hold {claimed}")
    room = min(claimed, max(_BLIND_BYTES, _MOST_TIMES * len(raw)))
    if compression == "":
        content = bytes(raw)
    elif compression == "zstd":
        content = _zstd(raw, room, cut)
    elif compression == "lz4":
        content = _lz4(raw, room, cut)
    else:
        raise DamagedError(f"compression {compression[:20]!r} is not known (only lz4, zstd and none are)")
    if not cut and len(content) != claimed:
        raise DamagedError(f"{len(content)} bytes come out where {claimed} are claimed")
    return content


def _zstd(raw: memoryview, claimed: int, cut: bool) -> bytes:
    import zstandard

    try:
        if not cut and claimed <= _BLIND_BYTES and zstandard.get_frame_parameters(raw).content_size == claimed:
            return zstandard.ZstdDecompressor().decompress(raw, max_output_size=max(claimed, 1))
        parts: list[bytes] = []
        room = claimed + 1
        with zstandard.ZstdDecompressor().stream_reader(raw, read_across_frames=True) as reader:
            while room > 0:
                try:
                    part = reader.read(min(room, _STEP_BYTES))
                except zstandard.ZstdError:
                    if cut:
                        break
                    raise
                if not part:
                    break
                parts.append(part)
                room -= len(part)
        return b"".join(parts)
    except (zstandard.ZstdError, MemoryError) as error:
        raise DamagedError(f"zstd cannot decompress it ({error})") from error


def _lz4(raw: memoryview, claimed: int, cut: bool) -> bytes:
    import lz4.frame

    parts: list[bytes] = []
    room = claimed + 1
    decompressor = lz4.frame.LZ4FrameDecompressor()
    given: bytes | memoryview = raw
    try:
        while room > 0 and not decompressor.eof:
            part = decompressor.decompress(given, max_length=min(room, _STEP_BYTES))
            given = b""
            if not part:
                break
            parts.append(part)
            room -= len(part)
    except (RuntimeError, EOFError, MemoryError) as error:
        if not cut:
            raise DamagedError(f"lz4 cannot decompress it ({error})") from error
    return parts[0] if len(parts) == 1 else b"".join(parts)
