"""A run's folder of results: written so that calibration.json is there only when all the rest is, and read again."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from sccal.batch.record import RECORD_FILE, FileMark, RunRecord, record_from, record_text
from sccal.errors import UsageError
from sccal.report.write import MCAP_FILE, PDF_FILE
from sccal.results.files import RESULT_FILE

_UNFINISHED = ".part"


def write_run(folder: Path, files: Mapping[str, bytes], record: RunRecord) -> None:
    """All files under temporary names, then renamed, calibration.json last; what an earlier call left over goes.

    Raises UsageError where the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for left_over in folder.glob(f".*{_UNFINISHED}"):
            left_over.unlink(missing_ok=True)
        last = (RECORD_FILE, RESULT_FILE)
        order = [*(name for name in files if name not in last), *last]
        contents = {**files, RECORD_FILE: record_text(record).encode()}
        written: dict[str, Path] = {}
        try:
            for name in order:
                written[name] = _beside(folder, name, contents[name])
            stale = _names_before(folder) - set(order)
            (folder / RESULT_FILE).unlink(missing_ok=True)
            for name in stale:
                (folder / name).unlink(missing_ok=True)
            for name in order:
                written[name].replace(folder / name)
        except BaseException:
            for path in written.values():
                path.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written ({error.strerror or error})") from error


def finished(folder: Path) -> RunRecord | None:
    """The record of a whole run: every result file there, as it was written. None where anything is missing."""
    record = _record(folder)
    if record is None:
        return None
    for name, mark in record.files.items():
        path = folder / name
        try:
            if path.stat().st_size != mark.size_bytes or FileMark.of(path.read_bytes()) != mark:
                return None
        except OSError:
            return None
    return record


def _record(folder: Path) -> RunRecord | None:
    try:
        return record_from((folder / RECORD_FILE).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None


def _names_before(folder: Path) -> set[str]:
    """Names of the result files that an earlier call wrote."""
    record = _record(folder)
    names = set() if record is None else {name for name in record.files if "/" not in name}
    return names | {MCAP_FILE, PDF_FILE}


def _beside(folder: Path, name: str, content: bytes) -> Path:
    with tempfile.NamedTemporaryFile(dir=folder, prefix=f".{name}.", suffix=_UNFINISHED, delete=False) as file:
        with suppress(OSError):
            Path(file.name).chmod(0o644)
        file.write(content)
    return Path(file.name)
