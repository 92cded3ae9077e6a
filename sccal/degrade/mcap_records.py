"""An MCAP file written again with some of its messages changed or left out, all other records byte for byte.

Chunks in which nothing changes are copied as they are; others are compressed anew in the same way, with their indexes
and CRCs. The summary's offsets and counts follow. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from sccal.errors import DataError
from sccal.logs.messages.mcap_chunks import DamagedError, decompressed
from sccal.logs.messages.mcap_magic import MAGIC

_FOOTER, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX = 2, 5, 6, 7, 8
_ATTACHMENT_INDEX, _STATISTICS, _METADATA_INDEX = 10, 11, 13
_SUMMARY_OFFSET, _DATA_END = 14, 15
_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")

Change = Callable[[int, int, bytes], bytes | None]
"""Channel, place of a message among its channel's (from 0) and its bytes; gives the new bytes, None to leave out."""


@dataclass
class _Rewriter:
    raw: bytes
    change: Change
    out: bytearray = field(default_factory=bytearray)
    counts: dict[int, int] = field(default_factory=dict)
    """Messages met, by channel."""
    kept: dict[int, int] = field(default_factory=dict)
    first_ns: int | None = None
    last_ns: int | None = None
    moved: dict[int, int] = field(default_factory=dict)
    """New place of each record that an index points at, by its old one."""
    chunk_indexes: dict[int, bytes] = field(default_factory=dict)
    """By the chunk's old place."""

    def run(self) -> bytes:
        self.out += MAGIC
        position, end = len(MAGIC), len(self.raw) - len(MAGIC)
        while position < end:
            opcode, length = _HEAD.unpack_from(self.raw, position)
            after = position + _HEAD.size + length
            if opcode == _CHUNK:
                position = self._chunk(position, after)
                continue
            if opcode == _DATA_END:
                self._end(position, after)
                break
            self.moved[position] = len(self.out)
            if opcode == _MESSAGE:
                self.out += self._messages(self.raw[position:after])[0]
            else:
                self.out += self.raw[position:after]
            position = after
        return bytes(self.out)

    def _messages(self, content: bytes) -> tuple[bytes, bool, dict[int, list[tuple[int, int]]]]:
        """Records with their messages changed; whether any was; and (log time, offset) of each by channel."""
        out, any_changed = bytearray(), False
        index: dict[int, list[tuple[int, int]]] = {}
        for opcode, begin, end in _records(content):
            if opcode != _MESSAGE:
                out += content[begin - _HEAD.size : end]
                continue
            channel, _, log_ns, _ = _MESSAGE_HEAD.unpack_from(content, begin)
            number = self.counts.get(channel, 0)
            self.counts[channel] = number + 1
            data = content[begin + _MESSAGE_HEAD.size : end]
            new = self.change(channel, number, data)
            any_changed |= new is not data
            if new is None:
                continue
            index.setdefault(channel, []).append((log_ns, len(out)))
            self.kept[channel] = self.kept.get(channel, 0) + 1
            self.first_ns = log_ns if self.first_ns is None else min(self.first_ns, log_ns)
            self.last_ns = log_ns if self.last_ns is None else max(self.last_ns, log_ns)
            out += _record(_MESSAGE, content[begin : begin + _MESSAGE_HEAD.size] + new)
        return bytes(out), any_changed, index

    def _chunk(self, position: int, after: int) -> int:
        """Write a chunk and the message indexes behind it; gives where the records after those begin."""
        start_ns, end_ns, claimed, crc = struct.unpack_from("<QQQI", self.raw, position + _HEAD.size)
        name_at = position + _HEAD.size + 28
        compression, at = _text(self.raw, name_at)
        (stored,) = struct.unpack_from("<Q", self.raw, at)
        try:
            content = decompressed(memoryview(self.raw)[at + 8 : at + 8 + stored], compression, claimed, False)
        except DamagedError as error:
            raise DataError(f"byte {position}: {error}") from error
        new, changed, index = self._messages(content)
        behind = after
        while self.raw[behind] == _MESSAGE_INDEX:
            behind += _HEAD.size + _HEAD.unpack_from(self.raw, behind)[1]
        self.moved[position] = start = len(self.out)
        if not changed:
            self.out += self.raw[position:behind]
            return behind
        times = [log_ns for entries in index.values() for log_ns, _ in entries]
        start_ns, end_ns = (min(times), max(times)) if times else (0, 0)
        packed = _compressed(new, compression)
        head = struct.pack("<QQQI", start_ns, end_ns, len(new), zlib.crc32(new) if crc else 0)
        body = head + self.raw[name_at:at] + struct.pack("<Q", len(packed)) + packed
        self.out += _record(_CHUNK, body)
        length = len(self.out) - start
        offsets: list[tuple[int, int]] = []
        if behind > after:
            for channel, entries in index.items():
                offsets.append((channel, len(self.out)))
                table = b"".join(struct.pack("<QQ", *entry) for entry in entries)
                self.out += _record(_MESSAGE_INDEX, struct.pack("<HI", channel, len(table)) + table)
        table = b"".join(struct.pack("<HQ", *entry) for entry in offsets)
        self.chunk_indexes[position] = b"".join(
            (
                struct.pack("<QQQQI", start_ns, end_ns, start, length, len(table)),
                table,
                struct.pack("<Q", len(self.out) - start - length),
                self.raw[name_at:at],
                struct.pack("<QQ", len(packed), len(new)),
            )
        )
        return behind

    def _end(self, position: int, after: int) -> None:
        """The end of the data and the summary, with new places and counts."""
        (crc,) = struct.unpack_from("<I", self.raw, position + _HEAD.size)
        self.out += _record(_DATA_END, struct.pack("<I", zlib.crc32(self.out) if crc else 0))
        footer = len(self.raw) - len(MAGIC) - _HEAD.size - 20
        summary, offsets, summary_crc = struct.unpack_from("<QQI", self.raw, footer + _HEAD.size)
        start = len(self.out)
        groups: dict[int, tuple[int, int]] = {}
        for opcode, begin, end in _records(self.raw[:footer], after):
            if opcode == _SUMMARY_OFFSET:
                continue
            here = len(self.out)
            self.out += _record(opcode, self._summarised(opcode, self.raw[begin:end]))
            groups[opcode] = (groups.get(opcode, (here, here))[0], len(self.out))
        offsets_start = len(self.out)
        if offsets:
            for opcode, (begin, end) in groups.items():
                self.out += _record(_SUMMARY_OFFSET, struct.pack("<BQQ", opcode, begin, end - begin))
        places = struct.pack("<QQ", start if summary else 0, offsets_start if offsets else 0)
        head = _HEAD.pack(_FOOTER, 20) + places
        crc = zlib.crc32(self.out[start:] + head) if summary_crc else 0
        self.out += head + struct.pack("<I", crc) + MAGIC

    def _summarised(self, opcode: int, record: bytes) -> bytes:
        if opcode == _CHUNK_INDEX:
            (old,) = struct.unpack_from("<Q", record, 16)
            if old in self.chunk_indexes:
                return self.chunk_indexes[old]
            shift = self.moved[old] - old
            (size,) = struct.unpack_from("<I", record, 32)
            moved = bytearray(record)
            struct.pack_into("<Q", moved, 16, old + shift)
            for at in range(36, 36 + size, 10):
                channel, place = struct.unpack_from("<HQ", record, at)
                struct.pack_into("<HQ", moved, at, channel, place + shift)
            return bytes(moved)
        if opcode in (_ATTACHMENT_INDEX, _METADATA_INDEX):
            (old,) = struct.unpack_from("<Q", record, 0)
            return struct.pack("<Q", self.moved.get(old, old)) + record[8:]
        if opcode == _STATISTICS:
            table = b"".join(struct.pack("<HQ", *one) for one in sorted(self.kept.items()))
            times = struct.pack("<QQ", self.first_ns or 0, self.last_ns or 0)
            count = struct.pack("<Q", sum(self.kept.values()))
            return count + record[8:26] + times + struct.pack("<I", len(table)) + table
        return record


def rewritten_mcap(raw: bytes, change: Change) -> bytes:
    """A whole MCAP file's bytes with its messages changed.

    Raises:
        DataError: the file is damaged or cut.
    """
    if len(raw) < 2 * len(MAGIC) + 2 * _HEAD.size or not raw.startswith(MAGIC) or not raw.endswith(MAGIC):
        raise DataError("the file is cut or no MCAP file; `mcap recover` makes a whole one")
    try:
        return _Rewriter(raw, change).run()
    except (struct.error, IndexError, KeyError, ValueError) as error:
        raise DataError(f"the file is damaged ({error}); `mcap recover` makes a whole one") from error


def _records(content: bytes, position: int = 0) -> Iterator[tuple[int, int, int]]:
    """Opcode, and [begin, end) of the content, of every record."""
    while position < len(content):
        opcode, length = _HEAD.unpack_from(content, position)
        begin = position + _HEAD.size
        position = begin + length
        if position > len(content):
            raise ValueError(f"a record of {length} bytes at byte {begin}")
        yield opcode, begin, position


def _record(opcode: int, body: bytes) -> bytes:
    return _HEAD.pack(opcode, len(body)) + body


def _text(raw: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", raw, at)
    return raw[at + 4 : at + 4 + length].decode(), at + 4 + length


def _compressed(content: bytes, compression: str) -> bytes:
    if compression == "zstd":
        import zstandard

        return zstandard.ZstdCompressor().compress(content)
    if compression == "lz4":
        import lz4.frame

        return bytes(lz4.frame.compress(content))
    return content
