"""What a file's first bytes tell before anything heavy is loaded: a log that cannot be one is refused at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sccal.errors import DataError
from sccal.logs.compressed import plain_name
from sccal.logs.formats import FOLDER_FILES, message_format, run_files_in


def require_any_log(paths: Sequence[Path]) -> None:
    """Where none of the runs given can be read, raise DataError of all of them; folders of runs are not looked into."""
    failures = []
    for path in paths:
        try:
            require_log(path)
        except DataError as error:
            failures.append(error)
    if paths and len(failures) == len(paths):
        raise DataError("; ".join(str(failure) for failure in failures))


def require_log(path: Path) -> None:
    """Look at the beginning of a file of messages, or of each file of a run's folder.

    Raises:
        DataError: a file that is not of the form that its name says.
    """
    messages = message_format(path)
    if messages is not None and messages.look is not None:
        messages.look(path)
    looks = {one.name: one.look for one in FOLDER_FILES if one.look is not None}
    folder = path.parent if plain_name(path.name).lower() in looks else path
    there = run_files_in([entry.name for entry in folder.iterdir()]) if folder.is_dir() else {}
    for name, look in looks.items():
        if name in there and (folder / there[name]).is_file():
            look(folder / there[name])
