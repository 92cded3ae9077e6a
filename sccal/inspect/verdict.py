"""Can this log be calibrated? Decided from the findings and from what the drive shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sccal.results.inspection import Inspection
from sccal.results.numbers import listed, one_line
from sccal.results.verdict import Verdict

FINDINGS_TOLD = 3


def judged_log(inspection: Inspection) -> Inspection:
    """The inspection with its verdict."""
    return replace(inspection, verdict=log_verdict(inspection))


def log_verdict(i: Inspection) -> Verdict:
    """good: a calibration can begin. partial: it can, with doubts. doubtful: it would refuse this log as it is."""
    refusals = [one_line(one.text) for one in i.findings if one.weight == "refused"]
    if refusals:
        return Verdict("doubtful", _some(refusals), "a calibration would refuse this log")
    warnings = [one_line(one.text) for one in i.findings if one.weight == "warning"]
    if warnings:
        return Verdict("partial", _some(warnings), "a calibration is possible and may be wrong")
    lacking = [one.title for one in i.excited[:3] if one.shown != "yes"]
    if lacking:
        return Verdict("partial", (f"this drive shows {listed(lacking)} badly or not at all",))
    return Verdict("good", ("all streams are there and agree, and the drive shows radii, track and heading offset",))


def _some(texts: Sequence[str]) -> tuple[str, ...]:
    more = len(texts) - FINDINGS_TOLD
    return (*texts[:FINDINGS_TOLD], *((f"{more} more below",) if more > 0 else ()))
