"""Many runs in one call, none stopped by another's failure.

The names below are loaded when they are first asked for: worker processes start before anything heavy is imported.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sccal.batch.calibrating import Batch, Progress, calibrate_paths
    from sccal.batch.diagnosing import diagnose_paths
    from sccal.batch.experimenting import experiment_on_paths
    from sccal.batch.inspecting import inspect_paths
    from sccal.batch.outcome import judged, write_outcome
    from sccal.batch.tasks import AlsoWritten

__all__ = [
    "AlsoWritten",
    "Batch",
    "Progress",
    "calibrate_paths",
    "diagnose_paths",
    "experiment_on_paths",
    "inspect_paths",
    "judged",
    "write_outcome",
]

_HOMES = {
    "AlsoWritten": "tasks",
    "Batch": "calibrating",
    "Progress": "calibrating",
    "calibrate_paths": "calibrating",
    "diagnose_paths": "diagnosing",
    "experiment_on_paths": "experimenting",
    "inspect_paths": "inspecting",
    "judged": "outcome",
    "write_outcome": "outcome",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
