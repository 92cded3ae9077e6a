"""One run that most tests spoil in their own way."""

from __future__ import annotations

from pathlib import Path

import pytest

from sccal.results.inspection import Inspection
from tests.inspect.logs import copied, inspected
from tests.runs import written

STANDS_S, REVERSES_M = 12.0, 8.0


@pytest.fixture(scope="session")
def general_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Stands, reverses, then turns both ways at several speeds."""
    folder = tmp_path_factory.mktemp("inspect") / "general"
    return written(folder, f"drive.stand_first_s={STANDS_S}", f"drive.reverse_first_m={REVERSES_M}", duration_s=150.0)


@pytest.fixture(scope="session")
def general(general_run: Path) -> Inspection:
    return inspected(general_run)


@pytest.fixture
def spoilt(general_run: Path, tmp_path: Path) -> Path:
    return copied(general_run, tmp_path)
