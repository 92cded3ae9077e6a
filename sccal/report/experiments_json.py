"""experiments.json: schema ``sccal.experiments/1``, strict JSON.

Lists per seed stand in the order of the cell's seeds; angles in degrees, lengths in metres; what is missing or not
finite is null.
"""

from __future__ import annotations

from typing import Any

from sccal import __version__
from sccal.experiments.magnetometer import WANDER_DEG, WANDER_TIME_S
from sccal.experiments.plan import TOLERANCE_PERCENT
from sccal.report.as_json import Json, strict_document, variant_key
from sccal.results.experiments import PARAMETERS, VARIANTS, Cell, Experiments, Spread, VariantFigures

SCHEMA = "sccal.experiments/1"


def experiments_json(e: Experiments) -> Json:
    """All cells, the simulated ones first, and the runs that gave nothing."""
    return strict_document(
        {
            "schema": SCHEMA,
            "sccal_version": __version__,
            "duration_s": e.duration_s,
            "seeds": e.seeds,
            "tolerance_percent": TOLERANCE_PERCENT,
            "magnetometer_wander": {"sigma_deg": WANDER_DEG, "time_s": WANDER_TIME_S},
            "cells": [_cell(cell) for cell in e.cells],
            "failed": [{"name": one.name, "reason": one.reason} for one in e.failed],
        }
    )


def _cell(cell: Cell) -> Json:
    while_s = cell.t_s[cell.judged]
    fault = cell.experiment
    return {
        "experiment": fault.key,
        "title": fault.title,
        "fault": {
            "kind": "loss" if fault.is_loss else "noise",
            "sigma_m": None if fault.is_loss else fault.sigma_m,
            "quality": fault.quality,
            "from_s": while_s[0] if while_s.size else None,
            "to_s": while_s[-1] if while_s.size else None,
        },
        "path": cell.path,
        "measured": cell.measured,
        "seeds": cell.seeds,
        "variants": {variant_key(variant == "with"): _variant(cell.figures[variant]) for variant in VARIANTS},
        "ratio": {"mean": cell.ratio.median, "interval_95": [cell.ratio.low, cell.ratio.high]},
        "truth": None if cell.truth is None else dict(zip(PARAMETERS, cell.truth, strict=True)),
        "errors_percent": dict(zip(PARAMETERS[:3], cell.errors_percent.T.tolist(), strict=True)),
        "within_percent": None if cell.truth is None else cell.within_percent,
        "why_not": cell.why_not,
    }


def _variant(figures: VariantFigures) -> Json:
    return {
        "rms_m": figures.rms_m.tolist(),
        **_spread("rms", figures.rms_spread_m),
        "end_m": figures.end_m.tolist(),
        **_spread("end", figures.end_spread_m),
        "parameters": {
            name: {
                "value": figures.values[:, k].tolist(),
                "sigma": figures.sigmas[:, k].tolist(),
                "status": [each[k] for each in figures.statuses],
            }
            for k, name in enumerate(PARAMETERS)
        },
    }


def _spread(name: str, spread: Spread) -> dict[str, Any]:
    return {f"{name}_median_m": spread.median, f"{name}_5_95_m": [spread.low, spread.high]}
