"""Every figure of a run that has data to show."""

from __future__ import annotations

from sccal.report.drawing.plan import Plan, drawn
from sccal.report.drawing.style import Drawing
from sccal.report.run.figure_causes import causes_plan
from sccal.report.run.figure_outage import outage_plan
from sccal.report.run.figure_path import path_plan
from sccal.report.run.figure_series import consistency_plan, parameters_plan, residuals_plan
from sccal.results.calibration import Calibration


def run_plans(c: Calibration) -> tuple[Plan, ...]:
    """In the order in which they are read."""
    plans = [path_plan(c), parameters_plan(c)]
    if c.outage.windows:
        plans.append(outage_plan(c.outage))
    plans.append(residuals_plan(c))
    if c.consistency:
        plans.append(consistency_plan(c))
    if c.causes:
        plans.append(causes_plan(c))
    return tuple(plans)


def run_drawings(c: Calibration) -> tuple[Drawing, ...]:
    """As SVG."""
    return tuple(drawn(plan) for plan in run_plans(c))
