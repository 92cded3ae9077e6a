"""diagnosis.json: schema ``sccal.diagnosis/1``, strict JSON.

Angles in degrees, effects' parameters in the units that stand beside them; what is missing or not finite is null.
"""

from __future__ import annotations

import math
from typing import Any

from sccal import __version__
from sccal.report.as_json import (
    Json,
    estimate_block,
    noise_block,
    notice_blocks,
    parameter_blocks,
    strict_document,
)
from sccal.results.diagnosis import Diagnosis, Finding, Judgement, Picture, Ranked, Unexplained

SCHEMA = "sccal.diagnosis/1"


def diagnosis_json(d: Diagnosis) -> Json:
    """The whole story as a document; findings in the order in which they were added."""
    return strict_document(
        {
            "schema": SCHEMA,
            "sccal_version": __version__,
            "vehicle": d.vehicle.name,
            "runs": d.runs,
            "trust": d.trust,
            "findings": [_finding(finding) for finding in d.findings],
            "taken_back": d.taken_back,
            "not_excited": [{"effect": one.name, "title": one.title, "advice": one.advice} for one in d.not_excited],
            "detectable": [
                {"effect": one.name, "title": one.title, "smallest": one.smallest, "units": one.units}
                for one in d.detectable
            ],
            "inseparable": [{"effects": one.names, "advice": one.advice} for one in d.inseparable],
            "before": _judgement(d.before),
            "after": _judgement(d.after),
            "held_out": {"how": d.held_out_how},
            "unexplained": _unexplained(d.unexplained),
            "placebo": {
                "tried": d.placebo.tried,
                "passed": d.placebo.passed,
                "highest_nats": d.placebo.highest_nats,
                "needed_nats": d.placebo.needed_nats,
            },
            "parameters_before": parameter_blocks(d.parameters_before),
            "parameters_after": parameter_blocks(d.parameters_after),
            "noise": [{"run": one.run, **noise_block(one.noise)} for one in d.noises],
            "notices": notice_blocks(d.notices),
        }
    )


def _finding(finding: Finding) -> Json:
    return {
        "effect": finding.name,
        "title": finding.title,
        "reference": finding.reference,
        "parameters": {
            name: {**estimate_block(estimate), "unit": finding.units.get(name, "")}
            for name, estimate in finding.parameters.items()
        },
        "evidence": {
            "evidence_nats": finding.evidence_nats,
            "held_out_gain_nats": finding.held_out_gain_nats,
            "t": finding.t,
        },
        "indistinguishable_from": finding.indistinguishable_from,
        "aligned": finding.aligned,
        "per_run": {name: [estimate_block(one) for one in each] for name, each in finding.per_run.items()},
        "advice": finding.advice,
        "drift_before_m": finding.drift_before_m,
        "drift_after_m": finding.drift_after_m,
        "ranking": [_ranked(one) for one in finding.ranking],
        "picture": _picture(finding.picture),
    }


def _ranked(one: Ranked) -> Json:
    return {
        "effect": one.name,
        "title": one.title,
        "named": one.named,
        "evidence_nats": one.evidence_nats,
        "t": one.t,
        "size": one.size,
    }


def _judgement(judgement: Judgement) -> Json:
    return {
        "outage_rms_m": judgement.outage_rms_m,
        "outage_end_rms_m": judgement.outage_end_rms_m,
        "outage_end_interval_m": judgement.outage_end_interval_m,
        "window_s": judgement.window_s,
        "windows": len(judgement.windows),
        "gnss_innovation_rms_m": judgement.gnss_innovation_rms_m,
        "heading_innovation_rms_deg": math.degrees(judgement.heading_innovation_rms_rad),
        "nll_per_measurement": judgement.nll_per_measurement,
    }


def _unexplained(left: Unexplained) -> Json:
    """The same keys whether or not anything is left: port and depends_on are null where nothing is."""
    there = left.significant
    return {
        "significant": there,
        "port": left.port if there else None,
        "depends_on": left.depends_on if there else None,
        "variance_fraction": left.variance_fraction if there else 0,
        "evidence_nats": left.evidence_nats if there else 0,
        "t": left.t if there else 0,
        "size": left.size if there else None,
        "picture": _picture(left.picture) if there else None,
    }


def _picture(picture: Picture | None) -> dict[str, Any] | None:
    if picture is None:
        return None
    return {
        "x_label": picture.x_label,
        "y_label": picture.y_label,
        "x": picture.x.tolist(),
        "before": picture.before.tolist(),
        "before_sigma": picture.before_sigma.tolist(),
        "after": picture.after.tolist(),
        "after_sigma": picture.after_sigma.tolist(),
        "model": picture.model.tolist(),
    }
