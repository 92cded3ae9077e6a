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

__all__ = ["Batch", "Progress", "calibrate_paths", "diagnose_paths", "experiment_on_paths", "inspect_paths"]

_HOMES = {
    "Batch": "calibrating",
    "Progress": "calibrating",
    "calibrate_paths": "calibrating",
    "diagnose_paths": "diagnosing",
    "experiment_on_paths": "experimenting",
    "inspect_paths": "inspecting",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
