"""calibration.json and vehicle.json: schema ``sccal.calibration/1``, strict JSON.

Angles in degrees; what is missing or not finite is null. A vehicle's file has the schema of a run's, with ``run`` set
to VEHICLE_RUN (no folder of results can have that name on its own) and the runs themselves under ``runs``.
The value of an unobserved parameter is its prior.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from sccal import __version__
from sccal.logs.streams import Notice
from sccal.report.rows import parameter_rows
from sccal.results.calibration import (
    AgainstReference,
    Calibration,
    Clock,
    Drive,
    Estimate,
    Fit,
    HeldOut,
    Missing,
    Noise,
    Outage,
    Parameters,
    Provenance,
    Unseen,
    VehicleCalibration,
)
from sccal.results.saved import SCHEMA, VEHICLE_RUN

Json = dict[str, Any]


def calibration_json(c: Calibration) -> Json:
    """One run."""
    return strict_document(
        {
            "schema": SCHEMA,
            "sccal_version": __version__,
            "run": c.run,
            "vehicle": c.vehicle.name,
            "started": None if c.started_utc_s is None else utc_text(c.started_utc_s),
            "variant": variant_key(c.with_offset),
            "verdict": str(c.verdict),
            "parameters": parameter_blocks(c.parameters),
            "effects": _effects(c.effects),
            "origin": {"lat_deg": c.origin_lat_deg, "lon_deg": c.origin_lon_deg, "alt_m": c.origin_alt_m},
            "fit": _fit(c.fit),
            "outage": _outage(c.outage),
            "held_out": _held_out(c.held_out),
            "missing": [_missing(one) for one in c.missing],
            "reference": _reference(c.against_reference),
            "unseen": [_unseen(one) for one in c.unseen],
            "noise": noise_block(c.noise),
            "drive": _drive(c.drive),
            "clock": clock_block(c.clock),
            "notices": notice_blocks(c.notices),
            "provenance": _provenance(c.provenance),
        }
    )


def vehicle_json(v: VehicleCalibration) -> Json:
    """Several runs of one vehicle as one problem."""
    return strict_document(
        {
            "schema": SCHEMA,
            "sccal_version": __version__,
            "run": VEHICLE_RUN,
            "vehicle": v.vehicle.name,
            "variant": variant_key(v.with_offset),
            "verdict": str(v.verdict),
            "parameters": parameter_blocks(v.parameters),
            "effects": _effects(v.effects),
            "consistency_chi2_per_dof": v.consistency_chi2_per_dof,
            "fit": _fit(v.fit),
            "outage": _outage(v.outage),
            "held_out": _held_out(v.held_out),
            "missing": [_missing(one) for one in v.missing],
            "runs": [
                {"run": c.run, "verdict": str(c.verdict), "parameters": parameter_blocks(c.parameters)} for c in v.runs
            ],
            "notices": notice_blocks(v.notices),
        }
    )


def json_text(document: Json) -> str:
    """As it stands in a file: indented, UTF-8, one newline at the end."""
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def variant_key(with_offset: bool) -> str:
    """As the files name the two filters of the paper."""
    return "sc_ekf_offset" if with_offset else "sc_ekf"


def utc_text(utc_s: float) -> str:
    """Unix time as ISO 8601 in UTC, to the second."""
    return datetime.fromtimestamp(utc_s, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _provenance(provenance: Provenance | None) -> Json | None:
    if provenance is None:
        return None
    return {
        "inputs": [{"name": one.name, "bytes": one.size_bytes, "sha256": one.sha256} for one in provenance.inputs],
        "options": dict(provenance.options),
        "versions": dict(provenance.versions),
    }


def parameter_blocks(parameters: Parameters) -> Json:
    """The four constants."""
    return {row.key: estimate_block(row.estimate) for row in parameter_rows(parameters)}


def _effects(effects: Mapping[str, Mapping[str, Estimate]]) -> Json:
    return {effect: {name: estimate_block(e) for name, e in named.items()} for effect, named in effects.items()}


def estimate_block(estimate: Estimate) -> Json:
    """One parameter."""
    return {
        "value": estimate.value,
        "sigma": estimate.sigma,
        "status": estimate.status,
        "reason": estimate.reason,
        "nominal": estimate.nominal,
        "prior_sigma": estimate.prior_sigma,
    }


def _fit(fit: Fit) -> Json:
    return {
        "gnss_innovation_rms_m": fit.gnss_innovation_rms_m,
        "heading_innovation_rms_deg": math.degrees(fit.heading_innovation_rms_rad),
        "nis_gnss": fit.nis_gnss,
        "nis_heading": fit.nis_heading,
        "fixes_used": fit.fixes_used,
        "fixes_rejected": fit.fixes_rejected,
        "headings_used": fit.headings_used,
        "headings_rejected": fit.headings_rejected,
        "recoveries": fit.recoveries,
    }


def _outage(outage: Outage) -> Json:
    return {
        "window_s": outage.window_s,
        "windows": len(outage.windows),
        "rms_m": outage.rms_m,
        "end_rms_m": outage.end_rms_m,
        "percent_of_distance": outage.percent_of_distance,
        "how": outage.how,
        "each": [
            {
                "start_s": window.start_s,
                "end_s": window.end_s,
                "distance_m": window.distance_m,
                "rms_m": window.rms_drift_m,
                "end_m": window.end_drift_m,
            }
            for window in outage.windows
        ],
    }


def _held_out(held_out: HeldOut | None) -> Json | None:
    if held_out is None:
        return None
    return {
        "outage_rms_m": held_out.outage_rms_m,
        "outage_end_rms_m": held_out.outage_end_rms_m,
        "how": held_out.how,
    }


def _missing(one: Missing) -> Json:
    return {"effect": one.effect, "title": one.title, "evidence_nats": one.evidence_nats, "size": one.size}


def _reference(judged: AgainstReference | None) -> Json | None:
    if judged is None:
        return None
    return {
        "losses": None if judged.losses is None else _outage(judged.losses),
        "displaced": judged.displaced,
        "displaced_rms_m": judged.displaced_rms_m,
    }


def _unseen(one: Unseen) -> Json:
    return {
        "effect": one.effect,
        "parameter": one.parameter,
        "unit": one.unit,
        "sigma": one.sigma,
        "smallest": one.smallest,
    }


def noise_block(noise: Noise) -> Json:
    """The levels of one run."""
    return {
        "heading_white_deg": math.degrees(noise.heading_white_rad),
        "heading_coloured_deg": math.degrees(noise.heading_coloured_rad),
        "heading_tau_s": noise.heading_tau_s,
        "fix_scale": noise.fix_scale,
        "other_fix_scale": {str(quality): scale for quality, scale in noise.other_fix_scale.items()},
        "fix_coloured_m": noise.fix_coloured_m,
        "fix_tau_s": noise.fix_tau_s,
        "slip_m_per_sqrt_m": noise.slip_m_per_sqrt_m,
        "fix_stated_m": noise.fix_stated_m,
        "apart_nats": noise.apart_nats,
        "source": noise.source,
    }


def _drive(drive: Drive) -> Json:
    return {
        "duration_s": drive.duration_s,
        "distance_m": drive.distance_m,
        "reversed_m": drive.reversed_m,
        "standing_s": drive.standing_s,
        "max_speed_mps": drive.max_speed_mps,
        "turned_left_deg": math.degrees(drive.turned_left_rad),
        "turned_right_deg": math.degrees(drive.turned_right_rad),
    }


def clock_block(clock: Clock) -> Json:
    """How the clocks were brought together."""
    return {
        "source": clock.source,
        "offset_s": clock.offset_s,
        "sigma_offset_s": clock.sigma_offset_s,
        "skew_ppm": clock.skew_ppm,
        "sigma_skew_ppm": clock.sigma_skew_ppm,
        "offset_at_start_s": clock.offset_at_start_s,
        "jitter_s": clock.jitter_s,
        "knots": clock.knots,
    }


def notice_blocks(notices: Iterable[Notice]) -> list[Json]:
    """Every notice with its count and place."""
    return [
        {
            "source": notice.source,
            "what": notice.what,
            "count": notice.count,
            "where": notice.where,
            "severity": notice.severity,
            "text": str(notice),
        }
        for notice in notices
    ]


def strict_document(blocks: Json) -> Json:
    """What json_text can write: numbers that are not finite become null, text encodes as UTF-8."""
    return {name: _strict(block) for name, block in blocks.items()}


def _strict(node: Any) -> Any:
    """Only what RFC 8259 knows: finite numbers (numpy's scalars become Python's), and text that encodes as UTF-8."""
    if isinstance(node, str):
        return node.encode("utf-8", "backslashreplace").decode("utf-8")
    if node is None or isinstance(node, bool):
        return node
    if isinstance(node, Mapping):
        return {_strict(key): _strict(value) for key, value in node.items()}
    if isinstance(node, Sequence):
        return [_strict(value) for value in node]
    number = node.item() if hasattr(node, "item") else node
    return None if isinstance(number, float) and not math.isfinite(number) else number
