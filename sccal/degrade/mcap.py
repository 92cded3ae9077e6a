"""One MCAP file with a fault: MCAP stays MCAP, message by message; beside it its manifest and its reference."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from sccal.degrade.faults import Faults
from sccal.degrade.folder import DegradedRun, Task, convention_of, fix_counts, manifest_of, with_earlier
from sccal.degrade.mcap_faults import Changes, LogOfMessages, changes_of
from sccal.degrade.mcap_patch import Patcher
from sccal.degrade.mcap_records import Change, rewritten_mcap
from sccal.degrade.reference import reference_text
from sccal.errors import DataError, UsageError
from sccal.logs.messages.converted import note_of
from sccal.logs.messages.layout import MalformedError
from sccal.logs.messages.mcap_file import Channel, read_mcap
from sccal.logs.messages.topics import Topics
from sccal.logs.reference import MANIFEST_FILE, REFERENCE_FILE, beside
from sccal.logs.run import RunSource
from sccal.logs.streams import Convention
from sccal.logs.write import write_bytes


def degrade_mcap(source: RunSource, target: Path, faults: Faults) -> DegradedRun:
    """Write a run that is an MCAP file with its faults to the file ``target``.

    Raises:
        UsageError: the place is taken, or a window lies outside the run.
        DataError: the file is damaged, or lacks what a fault would change.
    """
    manifest_path = beside(target, MANIFEST_FILE)
    if target.exists() and not manifest_path.is_file():
        raise UsageError(f"{target}: is there and was not written by sccal degrade; name another folder")
    notices: list[str] = []
    try:
        raw = source.path.read_bytes()
    except OSError as error:
        raise DataError(f"{source.path}: cannot be read ({error.strerror or error})") from error
    span_s = None
    changes = Changes()
    new = raw
    if faults.none:
        notices.append("no fault given: the file is as it was")
    else:
        convention = convention_of(source, faults)
        log, channels = _read(source, convention)
        span_s = log.span_s
        try:
            changes = changes_of(log, faults)
            new = rewritten_mcap(raw, _change(channels, changes))
        except (MalformedError, DataError) as error:
            raise DataError(f"{source.path}: {error}") from error
    rows = changes.rows
    if rows is not None:
        rows = with_earlier(rows, source.path, notices)
    fixes: Mapping[str, int] = {} if rows is None else fix_counts(rows, changes.outliers)
    entry: dict[str, object] = {
        "name": target.name,
        "sha256_before": hashlib.sha256(raw).hexdigest(),
        "sha256_after": hashlib.sha256(new).hexdigest(),
        "messages": {
            "rewritten": dict(sorted(changes.rewritten.items())),
            "left_out": dict(sorted(changes.left_out.items())),
        },
    }
    run = DegradedRun(source.name, target, fixes, dict(changes.left_out), tuple(notices))
    task = Task(faults, source.name, span_s, "enu")
    manifest = manifest_of(source, task, run, [entry], rows is not None)
    if rows is not None:
        manifest["reference"] = beside(target, REFERENCE_FILE).name
    target.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(target, new)
    if rows is not None:
        write_bytes(beside(target, REFERENCE_FILE), reference_text(rows))
    else:
        beside(target, REFERENCE_FILE).unlink(missing_ok=True)
    write_bytes(manifest_path, (json.dumps(manifest, indent=2, ensure_ascii=False) + "\n").encode())
    return run


def _read(source: RunSource, convention: Convention) -> tuple[LogOfMessages, list[Channel]]:
    topics = Topics({})
    metadata: dict[str, dict[str, str]] = {}
    broken = read_mcap(source.path, topics.open, metadata)
    if broken:
        told = "; ".join(str(notice) for notice in broken)
        raise DataError(f"{source.path}: is damaged ({told}); `mcap recover` makes a whole one")
    note = note_of(metadata)
    doubled = [topic for topic, sinks in topics.sinks.items() if len(sinks) > 1]
    found, _ = topics.messages(source.path.name, "header", note.log_ahead_ns if note else 0)
    found = {topic: messages for topic, messages in found.items() if topic not in doubled}
    channels = [sink.channel for topic in found for sink in topics.sinks[topic]]
    return LogOfMessages(found, note, convention, source.name), channels


def _change(channels: Sequence[Channel], changes: Changes) -> Change:
    """What becomes of each message of the file, of which only those of some channels may change."""
    patchers = {channel.number: Patcher(channel) for channel in channels}

    def change(channel: int, place: int, data: bytes) -> bytes | None:
        patcher = patchers.get(channel)
        if patcher is None:
            return data
        key = patcher.channel.topic, place + 1
        if key in changes.dropped:
            return None
        numbers, text = changes.numbers.get(key), changes.texts.get(key)
        if numbers is None and text is None:
            return data
        return patcher.patched(data, numbers or {}, text)

    return change
