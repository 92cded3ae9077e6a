"""Which files continue a drive: those that their recorder lists or numbers as parts, and no others."""

from __future__ import annotations

from pathlib import Path

import pytest

from sccal.logs.messages.parts import later_parts, parts_after


def touched(folder: Path, *names: str) -> list[Path]:
    for name in names:
        (folder / name).write_bytes(b"x")
    return [folder / name for name in names]


def test_what_rosbag2_lists_is_one_drive(tmp_path: Path) -> None:
    paths = touched(tmp_path, "run_0.mcap", "run_1.mcap", "run_10.mcap", "other.mcap")
    listed = "".join(f"    - {path.name}\n" for path in paths[:3])
    (tmp_path / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  relative_file_paths:\n{listed}  files: []\n"
    )
    assert parts_after(paths[0]) == tuple(paths[1:3])
    assert not parts_after(paths[1])
    assert later_parts(tmp_path, [path.name for path in paths]) == {"run_1.mcap", "run_10.mcap"}


def test_files_that_are_only_numbered_are_drives_of_their_own(tmp_path: Path) -> None:
    paths = touched(tmp_path, "run_0.mcap", "run_1.mcap", "run_0.bag", "run_1.bag")
    assert not later_parts(tmp_path, [path.name for path in paths])


@pytest.mark.parametrize("prefix", ["drive_", ""])
def test_parts_of_a_ros_1_record_are_one_drive(tmp_path: Path, prefix: str) -> None:
    names = [f"{prefix}2024-06-01-14-{minute:02d}-00_{part}.bag" for minute, part in ((0, 0), (5, 1), (10, 2), (30, 0))]
    paths = touched(tmp_path, *names)
    assert parts_after(paths[0]) == tuple(paths[1:3])
    assert later_parts(tmp_path, names) == set(names[1:3])
