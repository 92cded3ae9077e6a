"""What one run leaves for the vehicle's result and for a later ``--resume``: small, exact, and beside its results.

The record holds the calibration without its arrays over time, what the run says of the shared parameters, and the size
and hash of every result file. Numbers come back bit for bit.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, get_origin

import cattrs
import numpy as np

from sccal.arrays import Floats
from sccal.calibration.shared import SharedLikelihood
from sccal.results.calibration import Calibration, Fixes, History, Provenance, Residuals, Trajectory

RECORD_FILE = ".sccal.json"
SCHEMA = "sccal.record/3"


@dataclass(frozen=True)
class FileMark:
    """One result file as it was written."""

    size_bytes: int
    sha256: str

    @classmethod
    def of(cls, content: bytes) -> FileMark:
        """Of a file's content."""
        return cls(len(content), hashlib.sha256(content).hexdigest())


@dataclass(frozen=True)
class RunRecord:
    """One run, finished."""

    key: str
    """Of everything that the results depend on; see key_of."""
    calibration: Calibration
    """Without arrays over time, but for the outage windows' drifts; its provenance is given."""
    likelihood: SharedLikelihood | None
    """None where effects are estimated too."""
    files: Mapping[str, FileMark]
    """Every result file by name."""


def key_of(run: str, provenance: Provenance) -> str:
    """SHA-256 of a run's name and provenance, in hex: the same key, the same results."""
    text = json.dumps([run, _converter().unstructure(provenance)], sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def without_arrays(calibration: Calibration) -> Calibration:
    """The calibration without what grows with the run's length."""
    return replace(
        calibration,
        vehicle=replace(calibration.vehicle, path=Path(calibration.vehicle.path.name)),
        trajectory=_emptied(Trajectory),
        history=_emptied(History),
        residuals=_emptied(Residuals),
        fixes=_emptied(Fixes),
        on_the_way=None,
        causes=(),
        consistency=(),
    )


def record_text(record: RunRecord) -> str:
    """As JSON; equal records give equal text."""
    document = {"schema": SCHEMA, **_converter().unstructure(record)}
    return json.dumps(document, ensure_ascii=True, default=_plain) + "\n"


def record_from(text: str) -> RunRecord:
    """From JSON. Raises ValueError where it is none of this version's records."""
    try:
        document = json.loads(text)
        if document.get("schema") != SCHEMA:
            raise ValueError(f"schema {document.get('schema')!r}")
        return _converter().structure(document, RunRecord)
    except (AttributeError, KeyError, TypeError, cattrs.BaseValidationError) as error:
        raise ValueError(f"not a whole record: {error!r}") from error


def _emptied(kind: type[Any]) -> Any:
    return kind(*(np.zeros(0) for _ in fields(kind)))


def _plain(number: Any) -> Any:
    """numpy's integers and flags; its floats are Python's already."""
    return number.item()


def _is_array(kind: Any) -> bool:
    return kind is np.ndarray or get_origin(kind) is np.ndarray


def _packed(array: Floats) -> dict[str, Any]:
    values = np.ascontiguousarray(array, dtype="<f8")
    return {"shape": list(values.shape), "f8": base64.b64encode(values.tobytes()).decode("ascii")}


def _unpacked(block: dict[str, Any], _: Any) -> Floats:
    values = np.frombuffer(base64.b64decode(block["f8"]), dtype="<f8")
    return values.reshape(block["shape"]).astype(np.float64)


@cache
def _converter() -> cattrs.Converter:
    converter = cattrs.Converter(detailed_validation=False)
    converter.register_unstructure_hook_func(_is_array, _packed)
    converter.register_structure_hook_func(_is_array, _unpacked)
    converter.register_unstructure_hook(Path, str)
    converter.register_structure_hook(Path, lambda text, _: Path(text))
    return converter
