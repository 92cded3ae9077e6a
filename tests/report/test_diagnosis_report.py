"""The reports of a diagnosis: keys, units, words for signs, and pages that stand on their own."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.logs.streams import Notice, Vehicle
from sccal.report.diagnosis.figures import candidates, drift_before_after, finding_drawings, residual_plot
from sccal.report.diagnosis.page import diagnosis_html
from sccal.report.diagnosis.text import cause_clause, change_clause, diagnosis_text, next_line, verdict_sentence
from sccal.report.write import write_diagnosis
from sccal.results.calibration import Estimate, Noise, OutageWindow, Parameters
from sccal.results.converter import document_of, json_text
from sccal.results.diagnosis import (
    Detectable,
    Diagnosis,
    Finding,
    Inseparable,
    Judgement,
    NotExcited,
    Picture,
    Placebo,
    Ranked,
    RunNoise,
    Unexplained,
)
from sccal.results.model import JudgedEffect, JudgedModel
from tests.report.pages import assert_page

NAN = float("nan")
JUDGED = {
    "outage_rms_m",
    "outage_end_rms_m",
    "gnss_innovation_rms_m",
    "heading_innovation_rms_deg",
    "nll_per_measurement",
}


def judgement(end_rms_m: float | None, windows: int = 14, seed: int = 1) -> Judgement:
    rng = np.random.default_rng(seed)
    every = []
    for k in range(0 if end_rms_m is None else windows):
        t_s = 1000.0 + 40.0 * k + np.arange(0.2, 30.01, 0.2)
        rise = np.linspace(0.0, 1.0, t_s.size) ** 1.2
        drift_m = np.abs(
            end_rms_m * abs(rng.normal(1.0, 0.4)) * rise + 0.03 * np.cumsum(rng.normal(size=t_s.size)) / 10
        )
        rms_m = float(np.sqrt(np.mean(drift_m**2)))
        every.append(OutageWindow(1000.0 + 40.0 * k, float(t_s[-1]), 31.0, rms_m, float(drift_m[-1]), t_s, drift_m))
    return Judgement(
        tuple(every),
        30.0,
        None if end_rms_m is None else 0.55 * end_rms_m,
        end_rms_m,
        None if end_rms_m is None else (0.8 * end_rms_m, 1.25 * end_rms_m),
        0.214 if end_rms_m is None else 0.1 * end_rms_m,
        math.radians(1.5),
        -1.234,
    )


def picture(amplitude: float = 4.0, points: int = 24, seed: int = 5) -> Picture:
    rng = np.random.default_rng(seed)
    x = np.linspace(-180.0, 180.0, points)
    model = amplitude * np.cos(np.radians(x))
    sigma = np.full(points, 0.3)
    return Picture(
        "heading of the robot, deg",
        "heading residual, deg",
        x,
        model + 0.3 * rng.normal(size=points),
        sigma,
        0.3 * rng.normal(size=points),
        sigma,
        model,
    )


def ranking(chosen: str) -> tuple[Ranked, ...]:
    others = (
        Ranked("gnss_latency", CATALOGUE["gnss_latency"].title, True, 57.2, 9.1, 3.0),
        Ranked("along~ambient_c", "ambient_c stretches the distance driven", True, 41.0, 8.2, 2.0),
        Ranked("side_slip", CATALOGUE["side_slip"].title, True, 18.0, 5.1, 1.2),
        Ranked("slope", CATALOGUE["slope"].title, True, 0.4, 0.9, 0.3),
        Ranked("heading~ambient_c", "ambient_c turns the AHRS reading", True, -2.3, 0.2, 0.1),
    )
    return (Ranked(chosen, CATALOGUE[chosen].title, True, 372.4, 24.3, 18.0), *others)


def lever_arm(forward: Estimate, left: Estimate) -> Finding:
    return Finding(
        "lever_arm",
        CATALOGUE["lever_arm"].title,
        CATALOGUE["lever_arm"].reference,
        {"forward_m": forward, "left_m": left},
        {"forward_m": "m", "left_m": "m"},
        372.4,
        310.2,
        24.3,
        ("gnss_latency",),
        "spin in place both ways, and drive the same line at two speeds",
        ranking("lever_arm"),
        1.37,
        0.93,
        picture(0.74),
    )


RIGHT = lever_arm(Estimate(0.012, 0.021, "estimated"), Estimate(-0.742, 0.013, "estimated"))


def of(name: str, units: tuple[str, ...], *values: float, sigma: float = 0.004) -> Finding:
    """Any effect of the catalogue."""
    effect = CATALOGUE[name]
    names = [one.name for one in effect.parameters]
    return Finding(
        name,
        effect.title,
        effect.reference,
        {key: Estimate(value, sigma, "estimated") for key, value in zip(names, values, strict=True)},
        dict(zip(names, units, strict=True)),
        61.0,
        50.3,
        8.4,
        (),
        "",
        ranking(name),
        0.93,
        0.86,
        picture(),
    )


def logged(name: str, parameter: str, value: float) -> Finding:
    estimate = {parameter: Estimate(value, 0.002, "estimated")}
    return replace(RIGHT, name=name, title=f"{name} does something", parameters=estimate, units={parameter: "deg/unit"})


def diagnosis(*findings: Finding) -> Diagnosis:
    constants = Parameters(
        Estimate(0.0808312, 0.0000119, "estimated", nominal=0.08, prior_sigma=0.0016),
        Estimate(0.0799021, 0.0000123, "estimated", nominal=0.08, prior_sigma=0.0016),
        Estimate(0.71234, 0.00087, "estimated", nominal=0.70, prior_sigma=0.05),
        Estimate(math.radians(-3.2145), math.radians(0.152), "estimated", prior_sigma=math.pi),
    )
    noise = Noise(math.radians(0.42), math.radians(0.8), 17.3, 1.12, 0.011, 120.0, 0.0021)
    runs = ("yard/figure-eight", "yard/square", "field/rows")
    effects = tuple(JudgedEffect(one.name, one.title, one.parameters, one.units) for one in findings)
    return Diagnosis(
        runs=runs,
        vehicle=Vehicle("tracked-demo", Path("logs/vehicle.toml"), 0.08, 0.70, ticks_per_rev=32768),
        trust="every sensor with the noise that its own residuals show, outliers at a tenth",
        findings=findings,
        taken_back={"slope": "refitted it came out at 0.4 of the smallest size that matters, 0.9 of its sigma"},
        not_excited=(
            NotExcited("speed_slip", "wheels that slip more at higher speed", "drive at a second speed"),
            NotExcited("brake_slip", "slip while braking", "brake hard as well as gently, from more than one speed"),
            NotExcited("speed_field", "compass turned by the motors' field", "drive at a second speed"),
        ),
        detectable=(
            Detectable("lever_arm", CATALOGUE["lever_arm"].title, {"forward_m": 0.03, "left_m": 0.02},
                       {"forward_m": "m", "left_m": "m"}),
            Detectable("gnss_latency", CATALOGUE["gnss_latency"].title, {"s": 0.041}, {"s": "s"}),
            Detectable("missed_left", CATALOGUE["missed_left"].title, {"ratio": 0.005}, {"ratio": "1"}),
        ),
        inseparable=(Inseparable(("turn_scrub", "side_slip"), "drive laps both ways at two speeds"),),
        before=judgement(1.37, seed=1),
        after=judgement(0.86, seed=2),
        held_out_how="each of 3 runs judged by constants and effects fitted on the 2 others",
        unexplained=Unexplained(False),
        placebo=Placebo(60, 1, 3.21, 6.4),
        parameters_before=constants,
        parameters_after=replace(constants, track_m=replace(constants.track_m, value=0.70512)),
        noises=tuple(RunNoise(run, replace(noise, fix_scale=1.0 + 0.1 * k)) for k, run in enumerate(runs)),
        notices=(Notice("gnss.nmea", "sentences with a wrong checksum dropped", 12, "line 1023", "warning"),),
        model=JudgedModel("tracked-demo", constants, effects, dict.fromkeys(runs, noise), 0.86, "on the others"),
    )  # fmt: skip


ONE = diagnosis(RIGHT)
SLIP = of("turn_slip", ("s/rad",), 0.12)
TWO = diagnosis(RIGHT, SLIP)
NOTHING = replace(diagnosis(), after=judgement(1.37, seed=1))
LEFT_OVER = replace(
    NOTHING,
    unexplained=Unexplained(True, "heading", "speed squared", 0.34, 41.2, 6.3, "up to 2.1 deg", picture(2.1)),
)
WITHOUT_WINDOWS = replace(ONE, before=judgement(None), after=replace(judgement(None), gnss_innovation_rms_m=0.107))
MANY_RUNS = replace(
    TWO,
    runs=tuple(f"campaign-2024-06-01/a/rather/deep/folder/run-{k:02d}" for k in range(40)),
    noises=tuple(replace(TWO.noises[0], run=f"campaign/run-{k:02d}") for k in range(40)),
    not_excited=tuple(NotExcited(name, one.title, one.excited_by) for name, one in CATALOGUE.items()),
    detectable=tuple(
        Detectable(name, one.title, {p.name: p.matters for p in one.parameters if not p.shape},
                   {p.name: p.unit for p in one.parameters})
        for name, one in CATALOGUE.items()
    ),
    before=judgement(1.37, 300),
    after=judgement(0.86, 300),
)  # fmt: skip
ALL = {
    "one": ONE,
    "two": TWO,
    "nothing": NOTHING,
    "left over": LEFT_OVER,
    "without windows": WITHOUT_WINDOWS,
    "many runs": MANY_RUNS,
}
each = pytest.mark.parametrize("d", ALL.values(), ids=ALL.keys())


def unwrapped(text: str) -> str:
    return " ".join(text.split())


# --- words


@pytest.mark.parametrize(
    ("forward_m", "left_m", "says"),
    [
        (0.012, -0.742, "the antenna sits 0.74 m to the right of the track centre"),
        (0.012, 0.742, "the antenna sits 0.74 m to the left of the track centre"),
        (0.31, 0.001, "the antenna sits 0.31 m ahead of the track centre"),
        (-0.31, 0.001, "the antenna sits 0.31 m behind the track centre"),
        (-0.31, -0.742, "the antenna sits 0.31 m behind and 0.74 m to the right of the track centre"),
        (1.37, 0.742, "the antenna sits 1.37 m ahead and 0.74 m to the left of the track centre"),
    ],
)
def test_the_antenna_s_side_in_words(forward_m: float, left_m: float, says: str) -> None:
    found = lever_arm(Estimate(forward_m, 0.02, "estimated"), Estimate(left_m, 0.02, "estimated"))
    assert cause_clause(found) == says


@pytest.mark.parametrize(
    ("name", "values", "says"),
    [
        ("turn_slip", (0.12,), "the robot turns 12.0 % less than its wheels say for each rad/s of turn rate"),
        ("turn_slip", (-0.12,), "the robot turns 12.0 % more than its wheels say for each rad/s of turn rate"),
        ("speed_slip", (0.031,), "the robot travels 3.10 % less than its wheels say for each m/s of speed"),
        ("speed_slip", (-0.031,), "the robot travels 3.10 % further than its wheels say for each m/s of speed"),
        ("gnss_latency", (0.12,), "the fixes show where the antenna was 0.12 s before their stamp"),
        ("gnss_latency", (-0.12,), "the fixes show where the antenna was 0.12 s after their stamp"),
        ("heading_latency", (0.12,), "the AHRS readings show the heading of 0.12 s before their stamp"),
        (
            "hard_iron",
            (-3.0, 4.0, 0.0),
            "magnetised parts near the compass turn it by up to 5.00 deg, once per full turn",
        ),
        ("soft_iron", (0.3, 0.4, 0.0), "iron near the compass turns it by up to 0.50 deg, twice per full turn"),
        ("heading_drift", (-12.3,), "the AHRS heading drifts by 12.3 deg an hour to the right (clockwise)"),
        ("radius_step", (-0.02, 312.0), "both wheels' radii shrink by 2.00 % 312 s after the run's start"),
        ("missed_right", (0.02, 9.0), "the right wheel's counter loses 2.00 % of its counts above 9.00 rad/s"),
        ("missed_left", (0.02, 0.0), "the left wheel's counter loses 2.00 % of its counts"),
        ("speed_offset", (0.041, 0.02), "the wheels read 0.041 m/s too fast while the robot moves"),
        ("heading_scale", (-0.012,), "the AHRS reading turns 1.20 % less than the robot"),
        (
            "antenna_height",
            (1.4,),
            "the antenna stands 1.40 m above the ground, and swings out where the robot pitches and rolls",
        ),
        ("slope", (1.2,), "level distance shorter than the travelled one on a slope (ratio 1.2000)"),
    ],
)
def test_effects_in_words(name: str, values: tuple[float, ...], says: str) -> None:
    assert cause_clause(of(name, ("1",) * len(values), *values)) == says


def test_every_effect_has_a_sentence_and_a_change_of_sign_changes_it() -> None:
    for name, effect in CATALOGUE.items():
        units = tuple(one.unit for one in effect.parameters)
        plus, minus = (of(name, units, *(sign * 0.3 for _ in effect.parameters)) for sign in (1.0, -1.0))
        assert cause_clause(plus), name
        if name not in ("hard_iron", "soft_iron", "base_shift", "fix_smoothing", "heading_smoothing"):
            assert cause_clause(plus) != cause_clause(minus), name


@pytest.mark.parametrize(
    ("finding", "says"),
    [
        (logged("heading~motor_a", "deg_per_unit", -0.31),
         "the AHRS heading turns with motor_a, by 0.31 deg to the right (clockwise) per unit"),
        (logged("along~ambient_c", "per_unit", 0.002),
         "the distance driven changes with ambient_c, by +0.20 % per unit"),
        (logged("yaw~payload_kg", "per_unit", -0.002), "the turning changes with payload_kg, by -0.20 % per unit"),
        (logged("side~wind", "per_unit", -0.002),
         "wind pushes the robot to the right, by 0.20 % of the distance driven per unit"),
        (logged("along~odd", "not_known", 0.5), "along~odd does something (not_known 0.5000 deg/unit)"),
    ],
)  # fmt: skip
def test_columns_of_the_log_in_words(finding: Finding, says: str) -> None:
    assert cause_clause(finding) == says


def test_parameters_that_nobody_expected_and_numbers_that_are_missing_fall_back_to_the_title() -> None:
    per_run = replace(RIGHT, parameters={"run-1.forward_m": Estimate(0.3, 0.01, "estimated")}, units={})
    assert cause_clause(per_run) == f"{RIGHT.title} (run-1.forward_m 0.300)"
    lost = lever_arm(Estimate(NAN, NAN, "held"), Estimate(-0.742, 0.013, "estimated"))
    assert cause_clause(lost) == f"{RIGHT.title} (left_m -0.742 m)"


def test_the_verdict_is_one_sentence_with_cause_and_gain() -> None:
    assert verdict_sentence(ONE) == (
        "the antenna sits 0.74 m to the right of the track centre: with it the drift after 30 s without fixes falls "
        "from 1.37 m to 0.86 m, judged on runs that were not used for fitting; gnss_latency would explain the same as "
        "well"
    )
    single = replace(diagnosis(SLIP), runs=("yard",))
    assert verdict_sentence(single).endswith("judged on stretches of the run that were not used for fitting")
    assert "the track centre, and the robot turns 12.0 % less" in verdict_sentence(TWO)
    assert "with both the drift" in verdict_sentence(TWO)
    four = diagnosis(RIGHT, SLIP, of("slope", ("1",), 1.2), of("roll_slip", ("1",), 0.2))
    assert "and 2 more effects (slope, roll_slip): with all of them the drift" in verdict_sentence(four)


def test_the_drift_may_rise_stay_or_be_unknown() -> None:
    low, high = judgement(0.86), judgement(1.37)
    assert change_clause(low, high).endswith("rises from 0.86 m to 1.37 m")
    assert change_clause(low, replace(low, outage_end_rms_m=0.8599)).endswith("stays at 0.86 m")
    assert "the innovation of the fixes falls from 0.21 m to 0.11 m" in verdict_sentence(WITHOUT_WINDOWS)


# --- terminal


@each
@pytest.mark.parametrize("width", [80, 100, 120])
def test_no_line_is_wider_than_asked(d: Diagnosis, width: int) -> None:
    lines = diagnosis_text(d, width).splitlines()
    assert [line for line in lines if len(line) > width] == []


@pytest.mark.parametrize("d", [ONE, TWO])
def test_one_or_two_findings_fit_a_terminal(d: Diagnosis) -> None:
    assert len(diagnosis_text(d, 100).splitlines()) <= 36


def test_the_terminal_s_tables() -> None:
    lines = diagnosis_text(TWO, 100).splitlines()
    rows = [line.split() for line in lines]
    assert ["lever_arm", "forward_m", "0.012", "±", "0.021", "m", "372", "24"] in rows
    assert ["left_m", "-0.742", "±", "0.013", "m"] in rows
    assert ["turn_slip", "per_radps", "0.1200", "±", "0.0040", "s/rad", "61.0", "8.4"] in rows
    assert "drift after 30 s without fixes, held out m rms 1.37 (1.1 … 1.7) 0.860 (0.69 … 1.1)" in [
        " ".join(r) for r in rows
    ]
    assert ["innovation", "of", "the", "heading", "deg", "rms", "1.50", "1.50"] in rows


def test_what_limits_the_answer_is_said() -> None:
    text = unwrapped(diagnosis_text(ONE, 100))
    assert "or else lever_arm could as well be gnss_latency; to tell: spin in place both ways" in text
    assert "unseen speed_slip, speed_field: drive at a second speed" in text
    assert "alike turn_scrub and side_slip: drive laps both ways at two speeds" in text
    assert (
        "1 of 60 nonsense columns passed the usual test; the best has evidence of 3.2 nats, a finding needs 6.4 nats"
        in text
    )
    assert "back slope was taken back as a finding: refitted it came out at 0.4" in text
    assert "fixes 1.0 … 1.2 x stated sigma" in text
    assert "found if" not in text


def test_nothing_found_says_what_would_have_been() -> None:
    text = unwrapped(diagnosis_text(NOTHING, 100))
    assert text.startswith("nothing that the model lacks was found")
    assert "found if lever_arm forward_m 0.030 m, left_m 0.020 m; gnss_latency 0.041 s; missed_left 0.0050" in text
    assert "falls" not in text
    assert " nats t" not in text
    assert "falls" not in text


def test_something_without_a_name_is_never_called_nothing() -> None:
    text = unwrapped(diagnosis_text(LEFT_OVER, 100))
    assert text.startswith("no effect with a name was found, but something is there: the error of the heading readings")
    assert "follows speed squared (up to 2.1 deg, 34 % of its variance, evidence 41 nats, t 6.3)" in text
    assert "nothing that the model lacks" not in text


def test_names_from_outside_cannot_steer_the_terminal() -> None:
    column = logged("heading~a\x1b[2Jb", "deg_per_unit", 0.3)
    assert "\x1b" not in diagnosis_text(replace(diagnosis(column), runs=("r\x1b[2J",)), 100)


def test_the_terminal_report_needs_neither_matplotlib_nor_jinja2() -> None:
    code = (
        "import sys, sccal.report.diagnosis.text, sccal.report.write; "
        "print({'matplotlib', 'jinja2'} & set(sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout == "set()\n"


# --- JSON


def test_the_json_s_keys_and_units() -> None:
    document = document_of(replace(TWO, unexplained=LEFT_OVER.unexplained))
    assert document["schema"] == "sccal.diagnosis/1"
    assert list(document["runs"]) == list(TWO.runs)
    first, second = document["findings"]
    assert (first["effect"], second["effect"]) == ("lever_arm", "turn_slip")
    assert first["parameters"]["left_m"]["value"] == -0.742
    assert first["parameters"]["left_m"]["sigma"] == 0.013
    assert first["parameters"]["left_m"]["unit"] == "m"
    assert first["evidence"] == {"evidence_nats": 372.4, "held_out_gain_nats": 310.2, "t": 24.3}
    assert first["indistinguishable_from"] == ["gnss_latency"]
    assert second["indistinguishable_from"] == []
    assert document["not_excited"][0]["effect"] == "speed_slip"
    assert document["not_excited"][0]["advice"] == "drive at a second speed"
    assert set(document["before"]) >= JUDGED
    assert set(document["after"]) >= JUDGED
    assert document["before"]["outage_end_rms_m"] == 1.37
    assert document["after"]["outage_end_rms_m"] == 0.86
    assert document["before"]["heading_innovation_rms_deg"] == pytest.approx(1.5)
    assert document["held_out"]["how"].startswith("each of 3 runs")
    left = document["unexplained"]
    assert (left["significant"], left["port"], left["depends_on"]) == (True, "heading", "speed squared")
    assert left["variance_fraction"] == 0.34
    assert document["parameters_after"]["track_m"]["value"] == 0.70512
    assert document["parameters_before"]["heading_offset_deg"]["value"] == pytest.approx(-3.2145)
    assert document["noise"][0]["heading_white_deg"] == pytest.approx(0.42)


def test_nothing_unexplained_keeps_its_keys() -> None:
    left = document_of(ONE)["unexplained"]
    assert left["significant"] is False
    assert left["port"] is None
    assert left["depends_on"] is None
    assert left["variance_fraction"] == 0


@each
def test_the_json_is_strict(d: Diagnosis) -> None:
    text = json_text(document_of(d))
    json.loads(text, parse_constant=lambda constant: pytest.fail(f"{constant} is not JSON"))


def test_what_is_not_finite_is_null() -> None:
    holed = replace(
        RIGHT,
        t=np.float64(np.inf),
        parameters={"left_m": Estimate(-0.7, NAN, "at_bound")},
        picture=replace(picture(), after=np.full(24, NAN)),
    )
    before = replace(judgement(None), gnss_innovation_rms_m=NAN, heading_innovation_rms_rad=NAN)
    d = replace(diagnosis(holed), before=before, placebo=Placebo(0, 0, -math.inf, NAN))
    document = json.loads(json_text(document_of(d)))
    assert document["findings"][0]["evidence"]["t"] is None
    assert document["findings"][0]["parameters"]["left_m"]["sigma"] is None
    assert document["findings"][0]["picture"]["after"] == [None] * 24
    assert document["before"]["outage_end_rms_m"] is None
    assert document["before"]["heading_innovation_rms_deg"] is None
    assert document["placebo"]["highest_nats"] is None
    assert_page(diagnosis_html(d))
    assert "nan" not in unwrapped(diagnosis_text(d, 80)).lower().split()


# --- pages


@each
def test_pages_stand_on_their_own(d: Diagnosis) -> None:
    assert_page(diagnosis_html(d))


def test_the_page_tells_the_story_in_order() -> None:
    html = unwrapped(diagnosis_html(TWO))
    chapters = [
        "The antenna sits 0.74 m to the right of the track centre.",
        "1. Antenna off the middle between the wheels",
        "-0.742 ± 0.013 m",
        "2. Tracks that skid sideways in turns",
        "The error before and after",
        "1.37 (1.1 … 1.7)",
        "What else could explain it",
        "What is left unexplained",
        "What this drive could not show",
        "drive at a second speed".capitalize(),
        "What would have been found",
        "How far chance goes",
        "Taken back",
    ]
    places = [html.find(chapter) for chapter in chapters]
    assert -1 not in places
    assert places == sorted(places)
    assert html.count("<figure") == 5
    assert html.count("<svg") == 7, "a residual is drawn without its effect and with it"


def test_pages_without_findings() -> None:
    nothing, left_over = diagnosis_html(NOTHING), diagnosis_html(LEFT_OVER)
    assert "nothing found" in nothing
    assert "before" not in re.sub(r"<style>.*?</style>", "", nothing, flags=re.DOTALL).partition("How to read this")[0]
    assert nothing.count("<svg") == 1
    assert "nothing found" not in left_over
    assert left_over.count("<figure") == 2
    assert diagnosis_html(WITHOUT_WINDOWS).count("<figure") == 2


def test_names_are_escaped() -> None:
    evil = "<script>alert(1)</script>"
    column = replace(logged(f"heading~{evil}", "deg_per_unit", 0.3), title=evil, advice=evil)
    d = replace(diagnosis(column), runs=(evil,), trust=evil, taken_back={evil: evil}, held_out_how=evil)
    html = diagnosis_html(replace(d, noises=(replace(d.noises[0], run=evil),)))
    assert_page(html)
    assert html.count("&lt;script&gt;") >= 6


@each
def test_figures_are_small_well_formed_and_the_same_every_time(d: Diagnosis) -> None:
    for number in range(len(d.findings)):
        drawings = finding_drawings(d, number)
        assert [one.svg for one in drawings] == [one.svg for one in finding_drawings(d, number)]
        for one in drawings:
            ElementTree.fromstring(one.svg)
            assert len(one.svg) < 400_000
    svg = drift_before_after(d.before, d.after)
    ElementTree.fromstring(svg)
    assert len(svg) < 600_000


def test_figures_survive_holes() -> None:
    holed = replace(picture(points=200), after=np.full(200, NAN), before_sigma=np.full(200, NAN))
    ElementTree.fromstring(residual_plot(holed))
    ElementTree.fromstring(residual_plot(replace(holed, before=np.where(np.arange(200) % 3, NAN, 1.0))))
    ElementTree.fromstring(candidates(replace(RIGHT, ranking=RIGHT.ranking[1:]), NAN))


def test_all_files_are_written(tmp_path: Path) -> None:
    write_diagnosis(TWO, tmp_path / "new" / "out")
    written = sorted(path.name for path in (tmp_path / "new" / "out").iterdir())
    assert written == ["diagnosis.html", "diagnosis.json", "model.json"]
    document = json.loads((tmp_path / "new" / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert document["findings"][0]["effect"] == "lever_arm"
    page = (tmp_path / "new" / "out" / "diagnosis.html").read_text(encoding="utf-8")
    assert 'href="diagnosis.json"' in page
    assert 'href="model.json"' in page


def test_the_next_command_is_told() -> None:
    assert next_line(TWO, ["my runs"], "out/model.json") == "next: sccal calibrate 'my runs' --model out/model.json"
    assert "sccal calibrate … --model OUT/model.json" in diagnosis_html(TWO)
    assert next_line(NOTHING, ["runs"], "out/model.json").startswith("next: sccal calibrate runs (the model lacks")
    small = replace(TWO.model.effects[1], told=False)
    held = replace(TWO, model=replace(TWO.model, effects=(TWO.model.effects[0], small)))
    assert "holds 1 effect that is no finding" in next_line(held, [], "out/model.json")
