"""Runs behind URLs (``s3://fleet/2026/**``): listed first, each fetched by whoever works on it, and removed after.

The names below a URL are laid out as empty files and searched as a folder is, so the same rules find the same runs.
The part before the first wildcard stands for the folder given.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from sccal.errors import DataError, Failure, SccalError, UsageError
from sccal.logs.inputs import input_paths
from sccal.logs.run import RunSource, find_runs

_WILD = re.compile(r"[*?\[]")
_EXTRA = "s3"


@dataclass(frozen=True)
class RemoteRun:
    """A run found behind a URL: which files it is read from, and where they go to be found again."""

    name: str
    prefix: str
    """URL of the folder given."""
    place: str
    """The run's folder or file below the prefix; ``.`` for the prefix itself."""
    files: tuple[str, ...]
    """Everything that reading it opens, below the prefix."""
    vehicle_toml: str | None
    """Below the prefix."""


def is_url(path: object) -> bool:
    """Whether an argument names something that is no local path."""
    return "://" in str(path)


def find_sources(paths: Sequence[Path | str]) -> tuple[list[RunSource | RemoteRun], list[Failure]]:
    """All runs below local paths and URLs, named as one call; see sccal.logs.run.find_runs.

    Raises UsageError where a path does not exist, or what reads a URL is not installed.
    """
    urls = [str(path) for path in paths if is_url(path)]
    if not urls:
        found, failures = find_runs([Path(path) for path in paths])
        return list(found), failures
    with tempfile.TemporaryDirectory(prefix="sccal-") as scratch:
        layouts: dict[Path, str] = {}
        local: list[Path] = []
        failed: list[Failure] = []
        for number, path in enumerate(paths):
            if not is_url(path):
                local.append(Path(path))
                continue
            try:
                root, prefix, wanted = _laid_out(str(path), Path(scratch).resolve() / str(number))
            except DataError as error:
                failed.append(Failure(str(path), error))
                continue
            layouts[root] = prefix
            local.append(wanted)
        sources, failures = find_runs(local)
        failed += [_as_given(failure, layouts) for failure in failures]
        return [_remote(source, layouts) for source in sources], failed


@contextmanager
def fetched(source: RunSource | RemoteRun) -> Iterator[RunSource]:
    """The run on this machine's disk: itself, or a copy that is removed after."""
    if isinstance(source, RunSource):
        yield source
        return
    with tempfile.TemporaryDirectory(prefix="sccal-") as scratch:
        # Short of the last part of its URL, a run that is the prefix itself would have no name.
        root = Path(scratch) / (PurePosixPath(source.prefix).name or "run")
        root.mkdir()
        try:
            _fetch(source, root)
            vehicle = None if source.vehicle_toml is None else root / source.vehicle_toml
            yield RunSource(source.name, root / source.place, vehicle, root)
        except SccalError as error:
            raise type(error)(str(error).replace(str(root), source.prefix)) from error


def _fetch(source: RemoteRun, root: Path) -> None:
    fs, base = _opened(source.prefix)
    for name in source.files:
        target = root / name
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            fs.get_file(f"{base}/{name}", str(target))
        except Exception as error:  # every kind of store has errors of its own
            raise DataError(f"{source.prefix}/{name}: cannot be fetched ({error})") from error


def _remote(source: RunSource, layouts: dict[Path, str]) -> RunSource | RemoteRun:
    root = next((root for root in layouts if source.path == root or root in source.path.parents), None)
    if root is None:
        return source

    def below(path: Path) -> str:
        return path.relative_to(root).as_posix()

    files = tuple(dict.fromkeys(below(path) for _, path in input_paths(source)))
    vehicle = None if source.vehicle_toml is None else below(source.vehicle_toml)
    return RemoteRun(source.name, layouts[root], below(source.path), files, vehicle)


def _laid_out(url: str, scratch: Path) -> tuple[Path, str, Path]:
    """Empty files as the store has them: their root, the URL that it stands for, and which path of it was asked for."""
    wild = _WILD.search(url.partition("://")[2])
    prefix = url.rstrip("/") if wild is None else _before_wildcard(url)
    fs, base = _opened(prefix)
    try:
        if wild is None and fs.isfile(base):
            prefix, _, name = prefix.rpartition("/")
            fs, base = _opened(prefix)
            names = [one for one in _names(fs, base) if one == name or PurePosixPath(one).name == "vehicle.toml"]
        else:
            name, names = "", _names(fs, base)
    except SccalError:
        raise
    except Exception as error:  # every kind of store has errors of its own
        raise DataError(f"{url}: cannot be listed ({type(error).__name__}: {error})") from error
    if wild is not None:
        pattern = url[len(prefix) :].lstrip("/")
        names = [one for one in names if PurePosixPath(one).name == "vehicle.toml" or _matches(one, pattern)]
    if not names:
        raise DataError(f"{url}: nothing there")
    root = scratch / (PurePosixPath(base).name or "run")
    root.mkdir(parents=True)
    for one in names:
        (root / one).parent.mkdir(parents=True, exist_ok=True)
        (root / one).touch()
    return root, prefix, root / name if name else root


def _names(fs: Any, base: str) -> list[str]:
    """Every file below, by its path from there; none that would land elsewhere."""
    stem = fs._strip_protocol(base).rstrip("/")
    below = (str(one)[len(stem) :].lstrip("/") for one in fs.find(stem))
    return [one for one in below if one and ".." not in PurePosixPath(one).parts]


def _before_wildcard(url: str) -> str:
    scheme, _, rest = url.partition("://")
    kept = []
    for part in rest.split("/"):
        if _WILD.search(part):
            break
        kept.append(part)
    return f"{scheme}://{'/'.join(kept)}"


def _matches(name: str, pattern: str) -> bool:
    """Whether a file, or a folder that it is in, matches the pattern, in which ** stands for any number of folders."""
    parts = PurePosixPath(name).parts
    translated = re.compile(_translated(pattern))
    return any(translated.fullmatch("/".join(parts[:count])) for count in range(1, len(parts) + 1))


def _translated(pattern: str) -> str:
    out = []
    for token in re.findall(r"\*\*/?|\*|\?|\[[^\]]+\]|.", pattern):
        if token.startswith("**"):
            out.append("(?:.*/)?" if token.endswith("/") else ".*")
        elif token in "*?":
            out.append("[^/]" + ("*" if token == "*" else ""))
        elif token.startswith("[") and len(token) > 2:
            out.append("[" + token[1:-1].replace("!", "^", 1).replace("\\", "\\\\") + "]")
        else:
            out.append(re.escape(token))
    return "".join(out)


def _opened(url: str) -> tuple[Any, str]:
    """The store of a URL, and the path in it."""
    try:
        import fsspec
    except ImportError as error:
        raise UsageError(f"{url}: needs fsspec; pip install 'sccal-robotics[{_EXTRA}]'") from error
    try:
        fs, base = fsspec.core.url_to_fs(url)
    except ImportError as error:
        raise UsageError(f"{url}: cannot be read ({error}); pip install 'sccal-robotics[{_EXTRA}]'") from error
    except ValueError as error:
        raise UsageError(f"{url}: {error}") from error
    return fs, base.rstrip("/")


def _as_given(failure: Failure, layouts: dict[Path, str]) -> Failure:
    """The layout's paths are nobody's business: a message names the URL."""
    name, text = failure.name, str(failure.error)
    for root, prefix in layouts.items():
        name, text = name.replace(str(root), prefix), text.replace(str(root), prefix)
    return Failure(name, type(failure.error)(text))
