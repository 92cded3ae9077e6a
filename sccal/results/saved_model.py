"""model.json (schema ``sccal.model/1``) as a result among others: constants and effects that a diagnosis judged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sccal.errors import DataError
from sccal.results.document import read_document
from sccal.results.numbers import plain
from sccal.results.saved import VEHICLE_RUN, Saved

MODEL_SCHEMA = "sccal.model/1"
MODEL_FILE = "model.json"


def read_saved_model(path: Path) -> Saved:
    """A model in the form of a vehicle's result: constants, effects, and in place of a verdict how it was judged.

    Raises:
        DataError: the file is no model of the schema.
    """
    document, schema = read_document(path)
    if schema != MODEL_SCHEMA:
        raise DataError(f"{path}: its schema is {schema!r}, not {MODEL_SCHEMA}")
    try:
        saved = Saved(
            path,
            {
                "schema": MODEL_SCHEMA,
                "run": VEHICLE_RUN,
                "vehicle": str(document["vehicle"]),
                "verdict": _judged(document["held_out"]),
                "parameters": document["parameters"],
                "effects": {_name(one): one["parameters"] for one in document["effects"]},
                "runs": [{"run": str(one["run"])} for one in document["noise"]],
            },
        )
        _ = saved.parameters, saved.effects
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{path}: not all of a model is there ({error!r}); diagnose again") from error
    return saved


def _name(effect: Any) -> str:
    """An effect of one run alone is not the vehicle's, and goes by the run's name too."""
    return f"{effect['effect']}" if effect["run"] is None else f"{effect['effect']} of run {effect['run']}"


def _judged(held_out: Any) -> str:
    drift = held_out["outage_end_rms_m"]
    what = "model of a diagnosis"
    return what if drift is None else f"{what}: drift without fixes, held out, {plain(float(drift), 2)} m rms"
