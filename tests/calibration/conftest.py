"""What most tests of this folder leave out of a calibration."""

from __future__ import annotations

import pytest

from sccal.calibration import single
from sccal.calibration.missing import Lacking


@pytest.fixture(autouse=True)
def _quick_look_left_out(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The quick look for what the model lacks has tests of its own, and takes a third of a calibration's time."""
    if not request.module.__name__.endswith("test_missing"):
        monkeypatch.setattr(single, "look_for_missing", lambda problem, values, heading_rate_hz: Lacking())
