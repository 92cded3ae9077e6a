"""JUnit XML of a batch: what the test tabs of CI servers show.

One ``testsuite`` for each run; in it a ``testcase`` for the calibration itself (``<error>`` where it gave nothing), one
for each parameter (``<skipped>`` where the drive did not excite it, ``<failure>`` at a bound) and one for each gate.
Gates on a vehicle's result have a suite of their own. A suite's name is unique in the file and stands in ``classname``
as well, since GitLab shows that one and drops doubles; messages stand in the attribute and in the text, since some
readers know only one of the two. No element or attribute beyond what Jenkins' schema has.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping, Sequence

from sccal.errors import Failure, one_line
from sccal.report.fleet.gates import estimate_text, gate_line
from sccal.results.calibration import Calibration, Estimate, named_estimates
from sccal.results.differences import why_not_estimated
from sccal.results.gates import BatchOutcome, GateResult

SUITES = "sccal calibrate"

_Case = Callable[[ET.Element], None]


def junit_xml(outcome: BatchOutcome, seconds: Mapping[str, float] | None = None) -> str:
    """The whole document, UTF-8 with its declaration; ``seconds`` that each run took, by its name."""
    root = ET.Element("testsuites", name=SUITES)
    names: set[str] = set()
    for run in outcome.runs:
        of_run = [gate for gate in outcome.gates if (gate.run, gate.vehicle) == (run.run, run.vehicle.name)]
        _suite(root, _free(run.run, names), _run_cases(run, of_run), (seconds or {}).get(run.run, 0.0))
    for failure in outcome.failures:
        _suite(root, _free(failure.name, names), [("calibrate", _error(failure))], (seconds or {}).get(failure.name, 0))
    for vehicle in outcome.vehicles.values():
        of_vehicle = [gate for gate in outcome.gates if (gate.run, gate.vehicle) == (vehicle.run, vehicle.vehicle.name)]
        if of_vehicle:
            _suite(root, _free(f"{vehicle.run} {vehicle.vehicle.name}", names), _gate_cases(of_vehicle), 0.0)
    for count in ("tests", "failures", "errors"):
        root.set(count, str(sum(int(suite.get(count, "0")) for suite in root)))
    root.set("time", f"{sum(float(suite.get('time', '0')) for suite in root):.3f}")
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _suite(root: ET.Element, name: str, cases: Sequence[tuple[str, _Case]], seconds: float) -> None:
    suite = ET.SubElement(root, "testsuite", name=name, id=str(len(root)))
    names: set[str] = set()
    for what, fill in cases:
        took = seconds if what == "calibrate" else 0.0
        fill(ET.SubElement(suite, "testcase", name=_free(what, names), classname=name, time=f"{took:.3f}"))
    suite.set("tests", str(len(cases)))
    for tag, count in (("failure", "failures"), ("error", "errors"), ("skipped", "skipped")):
        suite.set(count, str(len(suite.findall(f"testcase/{tag}"))))
    suite.set("time", f"{seconds:.3f}")


def _run_cases(run: Calibration, gates: Iterable[GateResult]) -> list[tuple[str, _Case]]:
    return [
        ("calibrate", _passed(str(run.verdict))),
        *((name, _parameter(name, estimate)) for name, estimate in named_estimates(run).items()),
        *_gate_cases(gates),
    ]


def _gate_cases(gates: Iterable[GateResult]) -> list[tuple[str, _Case]]:
    return [(f"gate {gate.expression}", _gate(gate)) for gate in gates]


def _passed(text: str) -> _Case:
    return lambda case: _tell(case, "system-out", text)


def _error(failure: Failure) -> _Case:
    return lambda case: _tell(case, "error", str(failure.error), type(failure.error).__name__)


def _parameter(name: str, estimate: Estimate) -> _Case:
    why = why_not_estimated(estimate)
    if not why:
        return _passed(estimate_text(name, estimate))
    if estimate.status in ("unobserved", "held"):
        return lambda case: _tell(case, "skipped", why)
    return lambda case: _tell(case, "failure", why, estimate.status)


def _gate(gate: GateResult) -> _Case:
    if gate.outcome == "passed":
        return _passed(gate_line(gate))
    if gate.outcome == "skipped":
        return lambda case: _tell(case, "skipped", gate.reason)
    return lambda case: _tell(case, "failure", gate_line(gate), "gate")


def _tell(case: ET.Element, tag: str, text: str, kind: str = "") -> None:
    element = ET.SubElement(case, tag)
    element.text = _clean(text)
    if tag != "system-out":
        element.set("message", _clean(text))
    if kind:
        element.set("type", kind)


def _free(name: str, taken: set[str]) -> str:
    clean = _clean(name) or "unnamed"
    free, count = clean, 2
    while free in taken:
        free, count = f"{clean} ({count})", count + 1
    taken.add(free)
    return free


def _clean(text: str) -> str:
    """XML 1.0 forbids control characters, halves of surrogate pairs and U+FFFE; none of them is printable."""
    return one_line(text)
