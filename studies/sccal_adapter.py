"""The only place that touches sccal: calibrate by its command, diagnose by its batch call, results from files."""

from __future__ import annotations

import contextlib
import io
import json
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studies.arrays import Effects
from studies.columns import PER_UNIT

CALIBRATE_TIMEOUT_S = 1800.0
HEADING_RATE_HZ, WINDOW_S = 10.0, 30.0
"""The defaults of `sccal diagnose`."""
GOOD_VERDICT = "good"
CAUSE_WORDS = (
    r"iron|slip|lever|antenna|latency|skew|drift|field|scrub|slope|eccentric|counts|offset of|base|would name"
    r"|latenc|magnet|step"
)
"""A verdict that holds one of these tells of a cause; on a log without effects that is one too many. That a heading or
fixes wander is no cause, and true of some of these logs."""


@dataclass(frozen=True)
class Estimate:
    """A value with its sigma; the sigma is None where none is told."""

    value: float
    sigma: float | None
    status: str = "estimated"


@dataclass(frozen=True)
class Calibrated:
    """What `sccal calibrate` says of a run."""

    verdict: str
    parameters: dict[str, Estimate]
    noise: dict[str, Any]

    @property
    def names_a_cause(self) -> bool:
        """Whether the verdict tells of something that the model lacks."""
        return not self.verdict.startswith(GOOD_VERDICT) and re.search(CAUSE_WORDS, self.verdict) is not None


@dataclass(frozen=True)
class Finding:
    """One effect that `diagnose` names."""

    effect: str
    parameters: dict[str, Estimate]
    aliases: tuple[str, ...]


@dataclass(frozen=True)
class Diagnosed:
    """What `sccal diagnose` says of a run."""

    findings: tuple[Finding, ...]
    drift_before_m: float | None
    drift_after_m: float | None
    origin: tuple[float, float] | None
    """Latitude and longitude of the plane in which places are told, where the results say it."""


class SccalFailedError(RuntimeError):
    """Sccal left no result."""


def calibrate(folder: Path, out: Path) -> Calibrated:
    """Calibrate one run by the command and read its calibration.json."""
    command = [sys.executable, "-m", "sccal", "calibrate", str(folder), "--out", str(out), "--jobs", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=CALIBRATE_TIMEOUT_S, check=False)
    results = sorted(out.rglob("calibration.json"))
    if not results:
        raise SccalFailedError(f"calibrate ended with {done.returncode}: {_last_line(done.stderr or done.stdout)}")
    told = json.loads(results[0].read_text(encoding="utf-8"))
    return Calibrated(str(told.get("verdict", "")), _estimates(told["parameters"]), told.get("noise") or {})


def diagnose(folder: Path, out: Path) -> Diagnosed:
    """Diagnose one run in this process and read its diagnosis.json."""
    from sccal.batch.diagnosing import diagnose_paths
    from sccal.calibration.options import CalibrationOptions

    quiet = io.StringIO()
    with contextlib.redirect_stdout(quiet), contextlib.redirect_stderr(quiet):
        _, failures = diagnose_paths([folder], out, CalibrationOptions())
    result = out / "diagnosis.json"
    if not result.exists():
        raise SccalFailedError("diagnose: " + "; ".join(str(failure) for failure in failures))
    told = json.loads(result.read_text(encoding="utf-8"))
    findings = tuple(
        Finding(found["effect"], _estimates(found["parameters"]), tuple(found.get("indistinguishable_from") or ()))
        for found in told["findings"]
    )
    before, after = told.get("before") or {}, told.get("after") or {}
    return Diagnosed(findings, before.get("outage_end_rms_m"), after.get("outage_end_rms_m"), _origin(told, out))


def counted_from(folder: Path) -> dict[str, float]:
    """By further column of a log: the value from which sccal counts it."""
    from sccal.align import align
    from sccal.effects.logged import Range
    from sccal.logs.run import discover, read_run

    aligned = align(read_run(discover([folder])[0]))
    return {name: Range.of([series.values]).reference for name, series in aligned.extras.items()}


def as_told(effects: Effects, references: Mapping[str, float], counted: Mapping[str, float]) -> Effects:
    """The true effects in sccal's own terms: it counts columns from r, the simulator from a reference c₀.

    A share of the motion that grows with a column makes another constant of the rest,

        1 + p (c − c₀) = (1 + p (r − c₀)) (1 + p' (c − r))      p' = p / (1 + p (r − c₀))

    at the ports `along` and `yaw`. At `side` the rest is a constant angle between heading and way, tan α = p (r − c₀),
    which the heading's offset takes: p' = p cos² α, and a part of second order that no model has is left. Elsewhere p
    stays.
    """
    told = {name: dict(parameters) for name, parameters in effects.items()}
    for name, parameters in told.items():
        port, _, column = name.partition("~")
        if not column:
            continue
        away = parameters[PER_UNIT] * (counted.get(column, 0.0) - references[column])
        if port in ("along", "yaw"):
            parameters[PER_UNIT] /= 1.0 + away
        elif port == "side":
            parameters[PER_UNIT] /= 1.0 + away**2
    return told


def likelihood_margin(folder: Path, truth: dict[str, Any]) -> float:
    """Log-likelihood at the noise that sccal finds in a log, less that at the true levels, in nats.

    `truth` is the log's truth.json: `truth["noise"]` holds heading_white_deg, heading_slow_deg, heading_slow_s,
    fix_white_m, fix_slow_m, fix_slow_s and slip_m_per_sqrt_m, and `truth["scenario"]["instruments"]` what the receiver
    claims of its error. The law is that this is never below −1.

    Both sets of levels are compared on the same measurements, each with the constants fitted to it.
    """
    from dataclasses import replace

    import numpy as np

    from sccal.align import align
    from sccal.filter.noise import Search, estimate_noise
    from sccal.filter.options import FilterOptions
    from sccal.filter.start import coarse_constants, find_start
    from sccal.logs.run import discover, read_run

    aligned = align(read_run(discover([folder])[0]))
    start, options = find_start(aligned), FilterOptions()
    found, _ = estimate_noise(aligned, start, options, HEADING_RATE_HZ)
    levels = truth["noise"]
    true = replace(
        found,
        heading_white_rad=np.radians(levels["heading_white_deg"]),
        heading_coloured_rad=np.radians(levels["heading_slow_deg"]),
        heading_tau_s=levels["heading_slow_s"],
        fix_scale=levels["fix_white_m"] / found.fix_stated_m,
        fix_coloured_m=levels["fix_slow_m"],
        fix_tau_s=levels["fix_slow_s"],
        slip_m_per_sqrt_m=levels["slip_m_per_sqrt_m"],
    )
    search = Search(aligned, start, replace(options, soft_gate=True))
    _, fine = search.timelines(HEADING_RATE_HZ)
    rough = search.problem(fine, search.levels.centre).at_centre(coarse_constants(aligned, start))
    costs = []
    for noise in (found, true):
        logs = search.levels.logs(noise)
        _, here = search.settled(logs, search.about(fine, rough))
        cost, _ = search.settled(logs, here)
        costs.append(cost - search.levels.price(logs))
    return costs[1] - costs[0]


def true_model_drift(folder: Path, effects: Effects) -> float:
    """Drift (`outage_end_rms_m`, judged as in a diagnosis) of the model that is told which effects a log has.

    `effects` holds every true effect with its true parameters in sccal's terms, logged columns as `port~column`:
    {"per_unit": …}.

    """
    from sccal.align import align
    from sccal.calibration.held_out import judge
    from sccal.evidence.extension import Free, effect_by_name
    from sccal.evidence.model import Accepted, bare_model, refitted
    from sccal.filter.noise import Reach
    from sccal.filter.options import FilterOptions
    from sccal.logs.run import discover, read_run

    aligned = align(read_run(discover([folder])[0]))
    model = bare_model([aligned], FilterOptions(), HEADING_RATE_HZ)
    accepted = []
    for name, parameters in effects.items():
        effect = effect_by_name(name, aligned)
        shapes = {one.name: parameters[one.name] for one in effect.parameters if one.shape and one.name in parameters}
        private = any(one.scope == "run" for one in effect.parameters) and effect.search in ("moment", "place")
        accepted.append(Accepted(Free(effect, shapes), 0 if private else None))
    if accepted:
        model = refitted(model, accepted, reach=Reach.FEW)
    drift = judge(model, WINDOW_S).outage_end_rms_m
    if drift is None:
        raise SccalFailedError("no window without fixes fits into the run")
    return drift


def _estimates(parameters: dict[str, Any]) -> dict[str, Estimate]:
    """Parameters as both kinds of results hold them."""
    return {
        name: Estimate(float(told["value"]), told.get("sigma"), told.get("status", "estimated"))
        for name, told in parameters.items()
        if told.get("value") is not None
    }


def _origin(told: dict[str, Any], out: Path) -> tuple[float, float] | None:
    """The origin of the tangent plane: of the diagnosis itself, or of a calibration that it leaves beside it."""
    candidates = [told.get("origin")]
    candidates += [json.loads(path.read_text(encoding="utf-8")).get("origin") for path in out.rglob("calibration.json")]
    for origin in candidates:
        if isinstance(origin, dict) and origin.get("lat_deg") is not None:
            return float(origin["lat_deg"]), float(origin["lon_deg"])
    return None


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else "no message"
