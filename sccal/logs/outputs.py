"""Where logs made from logs go: apart from those that they come from, each with the vehicle.toml that applies."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from sccal.errors import Failure, SccalError, UsageError, as_known
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.run import RunSource

Made = TypeVar("Made")


def require_apart(out: Path, sources: Sequence[RunSource], paths: Sequence[Path]) -> None:
    """Logs are never written among the logs that they come from.

    ``paths`` are those of the command line: beside a file that was given by its name there is room for others.

    Raises UsageError where they would be.
    """
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out {out}: a file of that name is in the way")
    files = {path.resolve() for path in paths if path.is_file()}
    places = [(out, out.resolve()), *((out / source.name, (out / source.name).resolve()) for source in sources)]
    for source in sources:
        given = source.path.resolve() in files
        logs = [source.path] if given else [source.path, source.searched_up_to or source.path]
        for folder in logs:
            for place, there in places:
                real = folder.resolve()
                around = real in there.parents or there == real or (there in real.parents and not given)
                if around:
                    raise UsageError(
                        f"--out {out}: {place} overlaps with the logs in {folder}; name a folder outside of them"
                    )


def each_run(
    sources: Sequence[RunSource],
    work: Callable[[RunSource], Made],
    failures: list[Failure],
    tell: Callable[[RunSource, Made | SccalError], None],
) -> list[Made]:
    """What the work made of every run, told as it comes; one that fails is told, kept in failures, and stops none."""
    made: list[Made] = []
    for source in sources:
        try:
            one = work(source)
        except Exception as error:
            known = as_known(error)
            failures.append(Failure(source.name, known))
            tell(source, known)
            continue
        made.append(one)
        tell(source, one)
    return made


def shared_vehicle_place(source: RunSource, out: Path) -> Path:
    """The place below ``out`` that corresponds to where the vehicle.toml of a run stands below its root."""
    vehicle = source.vehicle_toml
    assert vehicle is not None
    root = source.searched_up_to or source.path
    name = Path(source.name)
    above = vehicle.parent.relative_to(root).parts if vehicle.parent.is_relative_to(root) else ()
    if source.path.is_dir() and vehicle.parent == source.path:
        above = source.path.parent.relative_to(root).parts if source.path != root else ()
    prefix = 0
    if source.path != root:
        prefix = len(name.parts) - len(source.path.relative_to(root).parts)
    return out.joinpath(*name.parts[:prefix], *above, VEHICLE_FILE)


def vehicle_place(source: RunSource, out: Path, own: Path) -> tuple[Path, bool]:
    """Where the vehicle.toml of a run found below its root goes for the log made of it below ``out``.

    The place that corresponds to the one where it stands, or that of the run's folder ``own`` where another vehicle's
    file is there already; the second value says so.
    """
    shared = shared_vehicle_place(source, out)
    assert source.vehicle_toml is not None
    if (own / VEHICLE_FILE).is_file() or (shared.is_file() and shared.read_bytes() != source.vehicle_toml.read_bytes()):
        return own / VEHICLE_FILE, True
    return shared, False


@dataclass(frozen=True)
class Note:
    """The file in which a command says what it wrote into a folder, so that it may write there again."""

    file: str
    kind: str
    command: str
    names_in: Callable[[Any], list[str]]
    """The files that the document names; raises ValueError, KeyError or TypeError where it is another's."""

    def earlier_files(self, target: Path) -> list[Path]:
        """What an earlier call left in the folder. Raises UsageError where something else stands there."""
        if not target.exists():
            return []
        if not target.is_dir():
            raise UsageError(f"{target}: a file of that name is in the way")
        path = target / self.file
        if not path.is_file():
            if any(one.is_file() for one in target.iterdir()):
                raise UsageError(f"{target}: holds files that sccal {self.command} did not write; name another folder")
            return []
        try:
            names = [Path(name) for name in self.names_in(json.loads(path.read_text(encoding="utf-8")))]
        except (ValueError, KeyError, TypeError):
            raise UsageError(f"{path}: not a {self.kind} of sccal {self.command}; name another folder") from None
        return [Path(self.file), *(name for name in names if not name.is_absolute() and ".." not in name.parts)]

    @contextmanager
    def staged(self, target: Path) -> Iterator[Path]:
        """A folder to write into, which then goes to ``target``, all of it or nothing, the note last.

        Raises UsageError where something else stands there.
        """
        earlier = self.earlier_files(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        staging = target.parent / f".{target.name}.{os.getpid()}.part"
        shutil.rmtree(staging, ignore_errors=True)
        staging.mkdir()
        try:
            yield staging
            if not target.exists():
                staging.rename(target)
                return
            for name in earlier:
                (target / name).unlink(missing_ok=True)
            found = sorted(path.relative_to(staging) for path in staging.rglob("*") if path.is_file())
            for relative in sorted(found, key=lambda path: path == Path(self.file)):
                (target / relative).parent.mkdir(parents=True, exist_ok=True)
                (staging / relative).replace(target / relative)
        finally:
            shutil.rmtree(staging, ignore_errors=True)
