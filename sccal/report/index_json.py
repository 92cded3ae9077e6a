"""summary.json: schema ``sccal.summary/1``, strict JSON. The same results give the same bytes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sccal import __version__
from sccal.report.as_json import Json, strict_document
from sccal.report.batch_json import gate_block
from sccal.report.index_lines import change_sentence
from sccal.results.gates import GateResult
from sccal.results.saved import SUMMARY_SCHEMA, SavedEstimate
from sccal.results.summary import Chart, RunLine, Summary, VehicleSummary


def summary_json(summary: Summary, gates: Sequence[GateResult] = ()) -> Json:
    """Lengths in m, angles in degrees; folders are named from the folder of results."""
    totals = summary.totals
    return strict_document(
        {
            "schema": SUMMARY_SCHEMA,
            "sccal_version": __version__,
            "totals": {
                "runs": totals.runs,
                "good": totals.good,
                "partial": totals.partial,
                "doubtful": totals.doubtful,
                "failed": totals.failed,
                "duration_s": totals.duration_s,
                "distance_m": totals.distance_m,
            },
            "runs": [_run(run) for run in summary.runs],
            "failures": [
                {"run": one.run, "reason": one.reason, "exit_code": one.exit_code} for one in summary.failures
            ],
            "vehicles": [_vehicle(vehicle) for vehicle in summary.vehicles],
            "gates": [gate_block(gate) for gate in gates],
        }
    )


def _run(run: RunLine) -> Json:
    return {
        "run": run.run,
        "vehicle": run.vehicle,
        "started": run.started,
        "verdict": run.verdict,
        "duration_s": run.duration_s,
        "distance_m": run.distance_m,
        "parameters": _estimates(run.parameters),
        "effects": {effect: _estimates(named) for effect, named in run.effects.items()},
        "fit": dict(run.fit),
        "outage": {
            "window_s": run.outage.window_s,
            "windows": run.outage.windows,
            "rms_m": run.outage.rms_m,
            "end_rms_m": run.outage.end_rms_m,
            "percent_of_distance": run.outage.percent_of_distance,
        },
        "warnings": list(run.warnings),
        "results": run.run,
        "inputs": [{"name": name, "sha256": sha256} for name, sha256 in run.inputs],
    }


def _vehicle(vehicle: VehicleSummary) -> Json:
    return {
        "vehicle": vehicle.label,
        "file": vehicle.file,
        "verdict": vehicle.verdict,
        "runs": vehicle.runs,
        "parameters": _estimates(vehicle.parameters),
        "trends": [
            *(_chart(vehicle.label, chart) for chart in vehicle.charts),
            *({"parameter": one.key, "no_chart": one.reason} for one in vehicle.no_charts),
        ],
    }


def _chart(vehicle: str, chart: Chart) -> Json:
    return {
        "parameter": chart.key,
        "by": "date" if chart.by_date else "order",
        "runs": list(chart.runs),
        "centre": chart.centre,
        "scatter": chart.scatter,
        "lower": chart.lower.tolist(),
        "upper": chart.upper.tolist(),
        "outside": [run for run, outside in zip(chart.runs, chart.outside, strict=True) if outside],
        "set_aside": [run for run, aside in zip(chart.runs, chart.set_aside, strict=True) if aside],
        "left_out": chart.left_out,
        "tested": chart.tested,
        "change": _change(vehicle, chart),
    }


def _change(vehicle: str, chart: Chart) -> Json | None:
    trend = chart.trend
    if trend is None:
        return None
    return {
        "shape": trend.shape,
        "value": trend.change,
        "sigma": trend.sigma,
        "days": trend.days,
        "from_run": chart.runs[trend.before],
        "to_run": chart.runs[trend.after],
        "from": chart.started[trend.before] if chart.by_date else None,
        "to": chart.started[trend.after] if chart.by_date else None,
        "p_value": trend.p_value,
        "sentence": change_sentence(vehicle, chart),
    }


def _estimates(estimates: Mapping[str, SavedEstimate]) -> Json:
    return {key: {"value": one.value, "sigma": one.sigma, "status": one.status} for key, one in estimates.items()}
