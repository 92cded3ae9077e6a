"""The MCAP container: records, chunks and channels, read in file order and handed on topic by topic.

A file is read up to where it breaks, chunk by chunk, with or without an index; of a chunk that is cut, what can be
decompressed is read. A chunk whose CRC or compression is wrong is left out and told. Lengths are checked against what
is there, and no size that the file only claims is allocated. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import struct
import zlib
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sccal.arrays import Ints
from sccal.errors import DataError
from sccal.logs.compressed import head_of
from sccal.logs.messages.mcap_chunks import DamagedError, decompressed
from sccal.logs.messages.mcap_magic import MAGIC, require_mcap
from sccal.logs.streams import Notice

Bytes = NDArray[np.uint8]

_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _CHUNK_INDEX, _METADATA, _DATA_END = 2, 3, 4, 5, 6, 8, 12, 15
_HEAD_BYTES = 9
RESULT_LIBRARY = "sccal calibrate"
"""Named in the header of files that hold results, and so are no runs."""
_LONGEST_HEADER = 1 << 16
_MESSAGE_HEAD = np.dtype([("channel", "<u2"), ("sequence", "<u4"), ("log", "<i8"), ("publish", "<i8")])
_BATCH_BYTES = 1 << 20
_BATCH_RECORDS = 200_000


@dataclass(frozen=True)
class Channel:
    """One channel of a log: a topic with the way its messages are written."""

    topic: str
    type_name: str
    message_encoding: str
    """cdr, ros1, protobuf or json."""
    schema_encoding: str
    """ros2msg, ros2idl, ros1msg, protobuf, jsonschema or empty."""
    schema: bytes
    number: int = 0
    """By which an MCAP file's messages name it."""


class Sink(Protocol):
    """Takes the messages of one channel, some thousand at a time."""

    def take(self, data: Bytes, begin: Ints, end: Ints, log_ns: Ints, publish_ns: Ints) -> None:
        """Messages at [begin, end) of ``data``; their times are (k,) ns. ``data`` must not be kept."""


OpenChannel = Callable[[Channel], Sink | None]
"""Gives the sink for a channel, or None where its messages are not wanted."""


def read_mcap(
    path: Path, open_channel: OpenChannel, metadata: dict[str, dict[str, str]] | None = None
) -> tuple[Notice, ...]:
    """Hand every wanted message of the file to its channel's sink; tell what was broken.

    ``metadata`` is filled with the file's metadata records by name.

    Raises:
        DataError: the file cannot be read, is empty, or is no MCAP file.
    """
    require_mcap(path)
    try:
        data = np.asarray(np.memmap(path, dtype=np.uint8, mode="r"))
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    return _Walk(path, data, open_channel, {} if metadata is None else metadata).run()


def library_of(path: Path) -> str:
    """What wrote the file, as its header says; empty where it says nothing or cannot be read."""
    try:
        begin = memoryview(head_of(path, _LONGEST_HEADER))
        _, at = _text(begin, len(MAGIC) + _HEAD_BYTES)
        return _text(begin, at)[0]
    except (DataError, struct.error, ValueError):
        return ""


@dataclass
class _Batch:
    """Record starts gathered over several small chunks."""

    parts: list[bytes] = field(default_factory=list)
    starts: list[Ints] = field(default_factory=list)
    size: int = 0


@dataclass
class _Walk:
    path: Path
    data: Bytes
    open_channel: OpenChannel
    metadata: dict[str, dict[str, str]]
    schemas: dict[int, tuple[str, str, bytes]] = field(default_factory=dict)
    sinks: dict[int, Sink | None] = field(default_factory=dict)
    chunk_starts: list[int] = field(default_factory=list)
    loose: list[int] = field(default_factory=list)
    """Places of messages outside chunks, not yet handed on."""
    batch: _Batch = field(default_factory=_Batch)
    lost: dict[str, tuple[int, str]] = field(default_factory=dict)
    """What was lost, with how often and where first."""
    last_ns: int = 0

    def run(self) -> tuple[Notice, ...]:
        view = self.data.data
        size = len(view)
        self._read_summary(view)
        head = struct.Struct("<BQ").unpack_from
        position, ended = len(MAGIC), False
        while position + _HEAD_BYTES <= size:
            opcode, length = head(view, position)
            begin = position + _HEAD_BYTES
            end = begin + length
            if end > size or opcode == 0:
                if opcode == _CHUNK:
                    self._chunk(view, position, begin, size, cut=True)
                resumed = self._next_chunk(position)
                self._break(position, (resumed or size) - position, "within a record" if opcode else "with zeros")
                if resumed is None:
                    ended = True
                    break
                position = resumed
                continue
            if opcode == _MESSAGE:
                self.loose.append(position)
                if len(self.loose) >= _BATCH_RECORDS:
                    self._flush()
            elif opcode == _CHUNK:
                self._chunk(view, position, begin, end, cut=False)
            elif opcode in (_SCHEMA, _CHANNEL):
                self._declare(opcode, view[begin:end], position)
            elif opcode == _METADATA:
                self._keep_metadata(view[begin:end])
            elif opcode in (_DATA_END, _FOOTER):
                ended = True
                self._flush()
                if bytes(view[-len(MAGIC) :]) != MAGIC:
                    self._lose("bytes of a cut index not used; all messages are read", size - position, position)
                if opcode == _DATA_END and length >= 4:
                    self._check_data_crc(view[:position], begin)
                break
            position = end
        self._flush()
        if not ended:
            self._break(position, size - position, "without its closing records")
        return tuple(
            Notice(self.path.name, what, count, where, "warning") for what, (count, where) in self.lost.items()
        )

    def _check_data_crc(self, section: memoryview, place: int) -> None:
        (stated,) = struct.unpack_from("<I", self.data.data, place)
        if stated and zlib.crc32(section) != stated:
            self._lose("bytes whose common CRC is wrong: the file was changed since", len(section), place)

    def _read_summary(self, view: memoryview) -> None:
        """Schemas, channels and chunk places of the summary at the file's end, where it is whole."""
        size = len(view)
        footer = size - len(MAGIC) - _HEAD_BYTES - 20
        if footer < len(MAGIC) or bytes(view[size - len(MAGIC) :]) != MAGIC or view[footer] != _FOOTER:
            return
        (position,) = struct.unpack_from("<Q", view, footer + _HEAD_BYTES)
        if not len(MAGIC) <= position <= footer:
            return
        while position + _HEAD_BYTES <= footer:
            opcode, length = struct.unpack_from("<BQ", view, position)
            begin, position = position + _HEAD_BYTES, position + _HEAD_BYTES + length
            if position > footer:
                break
            if opcode in (_SCHEMA, _CHANNEL):
                self._declare(opcode, view[begin:position], begin)
            elif opcode == _CHUNK_INDEX and length >= 24:
                self.chunk_starts.append(struct.unpack_from("<Q", view, begin + 16)[0])
        self.chunk_starts.sort()

    def _next_chunk(self, position: int) -> int | None:
        """Where the index says that the next chunk after a broken record begins."""
        after = bisect_right(self.chunk_starts, position)
        if after == len(self.chunk_starts):
            return None
        start = self.chunk_starts[after]
        return start if start + _HEAD_BYTES < self.data.size and self.data[start] == _CHUNK else None

    def _declare(self, opcode: int, record: memoryview, place: int) -> None:
        try:
            if opcode == _SCHEMA:
                number = struct.unpack_from("<H", record, 0)[0]
                name, at = _text(record, 2)
                encoding, at = _text(record, at)
                (length,) = struct.unpack_from("<I", record, at)
                if at + 4 + length > len(record):
                    raise ValueError("schema longer than its record")
                self.schemas.setdefault(number, (name, encoding, bytes(record[at + 4 : at + 4 + length])))
                return
            number, schema_number = struct.unpack_from("<HH", record, 0)
            if number in self.sinks:
                return
            topic, at = _text(record, 4)
            encoding, at = _text(record, at)
        except (struct.error, ValueError):
            self._lose("schema or channel records that cannot be read", 1, place)
            return
        name, schema_encoding, schema = self.schemas.get(schema_number, ("", "", b""))
        self.sinks[number] = self.open_channel(Channel(topic, name, encoding, schema_encoding, schema, number))

    def _keep_metadata(self, record: memoryview) -> None:
        try:
            name, at = _text(record, 0)
            (size,) = struct.unpack_from("<I", record, at)
            at, last, entries = at + 4, at + 4 + size, {}
            while at < last:
                key, at = _text(record, at)
                entries[key], at = _text(record, at)
        except (struct.error, ValueError):
            return
        self.metadata.setdefault(name, entries)

    def _chunk(self, view: memoryview, position: int, begin: int, end: int, cut: bool) -> None:
        try:
            start_ns, _, claimed, crc = struct.unpack_from("<QQQI", view[begin:end], 0)
            compression, at = _text(view[begin:end], 28)
            (stored,) = struct.unpack_from("<Q", view[begin:end], at)
        except (struct.error, ValueError):
            if not cut:
                self._lose("chunks without a whole head left out", 1, position)
            return
        body = view[begin + at + 8 : end]
        if not cut and stored > len(body):
            self._lose("chunks that claim more bytes than they hold left out", 1, position)
            return
        try:
            content = decompressed(body[:stored], compression, claimed, cut)
        except DamagedError as damage:
            if not cut:
                self._lose(f"chunks left out: {damage}", 1, position, start_ns)
            return
        if not cut and crc and zlib.crc32(content) != crc:
            self._lose("chunks left out because their CRC is wrong", 1, position, start_ns)
            return
        self._content(content, position, cut)

    def _content(self, content: bytes, position: int, cut: bool) -> None:
        """Walk a chunk's records: declare at once, keep the messages for the batch."""
        starts, whole = _record_starts(content)
        if not whole and not cut:
            self._lose("chunks that end within a record", 1, position)
        if starts.size == 0:
            return
        data = np.frombuffer(content, dtype=np.uint8)
        opcodes = data[starts]
        view = memoryview(content)
        for wanted in (_SCHEMA, _CHANNEL):
            for start in starts[opcodes == wanted].tolist():
                (length,) = struct.unpack_from("<Q", content, start + 1)
                self._declare(wanted, view[start + _HEAD_BYTES : start + _HEAD_BYTES + length], position)
        messages = starts[opcodes == _MESSAGE]
        batch = self.batch
        if len(content) >= _BATCH_BYTES and not batch.parts:
            self._messages(data, messages)
            return
        batch.parts.append(content)
        batch.starts.append(messages + batch.size)
        batch.size += len(content)
        if batch.size >= _BATCH_BYTES:
            self._flush()

    def _flush(self) -> None:
        if self.loose:
            starts = np.array(self.loose, dtype=np.int64)
            self.loose.clear()
            self._messages(self.data, starts)
        batch, self.batch = self.batch, _Batch()
        if batch.parts:
            data = np.frombuffer(b"".join(batch.parts), dtype=np.uint8)
            self._messages(data, np.concatenate(batch.starts))

    def _messages(self, data: Bytes, starts: Ints) -> None:
        """Split the message records that begin at ``starts`` by channel."""
        if starts.size == 0:
            return
        lengths = _gathered(data, starts + 1, 8).view("<u8").ravel()
        short = lengths < _MESSAGE_HEAD.itemsize
        if short.any():
            self._lose("message records shorter than their head left out", int(short.sum()), int(starts[short][0]))
            starts, lengths = starts[~short], lengths[~short]
            if starts.size == 0:
                return
        heads = _gathered(data, starts + _HEAD_BYTES, _MESSAGE_HEAD.itemsize).view(_MESSAGE_HEAD).ravel()
        begin = starts + _HEAD_BYTES + _MESSAGE_HEAD.itemsize
        end = starts + _HEAD_BYTES + lengths.astype(np.int64)
        log_ns, publish_ns = heads["log"].astype(np.int64), heads["publish"].astype(np.int64)
        self.last_ns = max(self.last_ns, int(log_ns.max()))
        channels = heads["channel"]
        for number in np.unique(channels).tolist():
            if number not in self.sinks:
                count = int((channels == number).sum())
                self._lose("messages of channels that are declared nowhere left out", count, None)
                continue
            sink = self.sinks[number]
            if sink is not None:
                rows = np.flatnonzero(channels == number)
                sink.take(data, begin[rows], end[rows], log_ns[rows], publish_ns[rows])

    def _break(self, position: int, count: int, how: str) -> None:
        self._flush()
        size = self.data.size
        self._lose(f"bytes of {size} lost: the file breaks off {how}; all before is read", count, position)

    def _lose(self, what: str, count: int, position: int | None, at_ns: int = 0) -> None:
        before, where = self.lost.get(what, (0, ""))
        if not where and position is not None:
            at_ns = at_ns or self.last_ns
            where = f"byte {position}, t = {at_ns * 1e-9:.3f} s" if at_ns else f"byte {position}"
        self.lost[what] = (before + count, where)


def _text(record: memoryview, at: int) -> tuple[str, int]:
    """A string with its length before it, and the place after it."""
    (length,) = struct.unpack_from("<I", record, at)
    if at + 4 + length > len(record):
        raise ValueError("text longer than its record")
    return str(record[at + 4 : at + 4 + length], "utf-8", "replace"), at + 4 + length


def _record_starts(content: bytes) -> tuple[Ints, bool]:
    """Where the whole records of a chunk begin, and whether the last one ends with the chunk."""
    starts: list[int] = []
    add, length_at = starts.append, struct.Struct("<Q").unpack_from
    position, size = 0, len(content)
    last = size - _HEAD_BYTES
    while position <= last:
        length = length_at(content, position + 1)[0]
        if not length:  # no record is empty: these are zeros, of which there may be very many
            return np.array(starts, dtype=np.int64), False
        add(position)
        position += _HEAD_BYTES + length
    if position > size:
        starts.pop()
    return np.array(starts, dtype=np.int64), position == size


def _gathered(data: Bytes, starts: Ints, width: int) -> Bytes:
    """(k, width) bytes from each start on, which all lie within ``data``."""
    windows = np.lib.stride_tricks.as_strided(data, (data.size - width + 1, width), (1, 1), writeable=False)
    rows: Bytes = windows[starts]
    return rows
