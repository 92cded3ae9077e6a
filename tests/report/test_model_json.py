"""model.json: what a diagnosis judged comes back as it was, and a damaged file says what is wrong with it."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sccal.calibration.judged_model import digest_of, read_judged_model
from sccal.effects.catalogue import CATALOGUE
from sccal.errors import DataError, UsageError
from sccal.results.calibration import Estimate, Noise, Parameters
from sccal.results.converter import document_of, json_text, result_from
from sccal.results.model import JudgedEffect, JudgedModel, Range
from tests.report.conftest import estimates

NAN = float("nan")
NOISE = Noise(
    math.radians(0.42), math.radians(0.8), 17.3, 1.12, 0.011, 120.0, 0.0021, "estimated", {1: 2.5, 5: 1.1}, 0.015, 0.4
)


def effect(name: str, run: str = "", told: bool = True, **shapes: float) -> JudgedEffect:
    known = CATALOGUE[name]
    free = [one for one in known.parameters if not one.shape]
    parameters = {one.name: Estimate(0.1, 0.01, "estimated", "", None, one.prior_sigma) for one in free}
    return JudgedEffect(name, known.title, parameters, {p.name: p.unit for p in known.parameters}, shapes, run, told)


MODEL = JudgedModel(
    "tracked-demo",
    estimates(),
    (
        effect("lever_arm"),
        effect("hard_iron", tau_s=22.0),
        effect("heading_step", run="yard/two", at_s=312.25),
        replace(effect("turn_slip", told=False), prior_scale=0.5),
        JudgedEffect(
            "heading~motor_current_a",
            "motor_current_a turns the AHRS reading",
            {"deg_per_unit": Estimate(0.3, NAN, "estimated")},
            {"deg_per_unit": "deg/unit"},
            column=Range(0.0, 2.5),
        ),
    ),
    {"yard/one": NOISE, "yard/two": replace(NOISE, fix_stated_m=NAN)},
    0.0523,
    "each of 2 runs judged by the other",
)


def close(found: Any, wanted: Any) -> bool:
    """Equal but for the last digits that degrees cost."""
    if isinstance(wanted, float) and isinstance(found, float):
        return found == pytest.approx(wanted, rel=1e-14, nan_ok=True)
    if isinstance(wanted, dict):
        return found.keys() == wanted.keys() and all(close(found[key], wanted[key]) for key in wanted)
    if isinstance(wanted, tuple):
        return len(found) == len(wanted) and all(map(close, found, wanted))
    if hasattr(wanted, "__dataclass_fields__"):
        return type(found) is type(wanted) and close(vars(found), vars(wanted))
    return bool(found == wanted)


def stored(folder: Path, document: Any) -> Path:
    path = folder / "model.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_a_model_comes_back_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text(json_text(document_of(MODEL)), encoding="utf-8")
    assert close(read_judged_model(path), MODEL)
    assert digest_of(read_judged_model(path)) == digest_of(MODEL)
    unjudged = replace(MODEL, outage_end_rms_m=None, effects=())
    assert close(result_from(json.loads(json_text(document_of(unjudged))), JudgedModel), unjudged)


def test_angles_are_degrees_and_the_document_is_strict() -> None:
    text = json_text(document_of(MODEL))
    document = json.loads(text, parse_constant=lambda constant: pytest.fail(f"{constant} is not JSON"))
    assert document["schema"] == "sccal.model/1"
    assert document["parameters"]["heading_offset_deg"]["value"] == pytest.approx(-3.2145)
    assert document["noise"][0]["heading_white_deg"] == pytest.approx(0.42)
    assert document["noise"][0]["run"] == "yard/one"
    assert document["effects"][1]["shapes"] == {"tau_s": {"value": 22.0, "unit": "s"}}
    assert document["effects"][4]["parameters"]["deg_per_unit"]["sigma"] is None
    assert document["held_out"] == {"outage_end_rms_m": 0.0523, "how": MODEL.how}


def test_another_model_has_another_digest() -> None:
    more = replace(NOISE, fix_scale=NOISE.fix_scale * (1.0 + 1e-12))
    digests = {
        digest_of(MODEL),
        digest_of(replace(MODEL, noises={"yard/one": more})),
        digest_of(replace(MODEL, effects=MODEL.effects[:-1])),
        digest_of(replace(MODEL, parameters=Parameters(*list(vars(estimates()).values())[:3], Estimate(0, 0, "held")))),
    }
    assert len(digests) == 4


def put(document: dict[str, Any], place: str, value: Any) -> dict[str, Any]:
    """A copy with one place changed; a value of ... takes it away."""
    document = json.loads(json.dumps(document))
    *way, last = [int(part) if part.isdigit() else part for part in place.split("/")]
    node: Any = document
    for part in way:
        node = node[part]
    if value is ...:
        del node[last]
    else:
        node[last] = value
    return document


@pytest.mark.parametrize(
    ("place", "value", "says"),
    [
        ("schema", "sccal.diagnosis/1", "its schema is 'sccal.diagnosis/1', not sccal.model/1"),
        ("vehicle", 3, "vehicle: must be text, not 3"),
        ("parameters/track_m", ..., "parameters.track_m: is missing"),
        ("parameters/track_m/value", "wide", "parameters.track_m.value: must be a number, not 'wide'"),
        ("parameters/track_m/status", "sure", "parameters.track_m.status: must be one of estimated"),
        ("effects", {}, "effects: must be a list"),
        ("effects/0/effect", "levitation", "effects[0].effect: no effect called 'levitation'; there are lever_arm"),
        ("effects/0/parameters/up_m", {"value": 1, "sigma": 1}, "effects[0].parameters.up_m"),
        ("effects/1/shapes/at_s", {"value": 1.0, "unit": "s"}, "effects[1].shapes.at_s: hard_iron has no such one"),
        ("effects/2/shapes", {}, "effects[2].shapes.at_s: is missing, and heading_step is nothing without it"),
        ("effects/3/prior_scale", 0.0, "effects[3].prior_scale: must be above zero"),
        ("effects/3/told", 1, "effects[3].told: must be true or false"),
        ("effects/3/run", 1, "effects[3].run: must be text, not 1"),
        ("noise/1/fix_tau_s", None, "noise[1].fix_tau_s: must be a number above zero"),
        ("noise/1/fix_tau_s", -1, "noise[1].fix_tau_s: must be a number above zero"),
        ("noise/0/other_fix_scale/good", 1.0, "noise[0].other_fix_scale.good: is no whole number"),
        ("noise/0", [], "noise[0]: must be a block of names"),
        ("held_out/how", ..., "held_out.how: is missing"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path: Path, place: str, value: Any, says: str) -> None:
    path = stored(tmp_path, put(document_of(MODEL), place, value))
    with pytest.raises(DataError) as caught:
        read_judged_model(path)
    assert str(caught.value).startswith(str(path))
    assert says in str(caught.value)


def test_files_that_are_no_documents(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        read_judged_model(tmp_path / "model.json")
    for content in ("", "{", '{"schema": NaN}', "[]", '"text"', '{"schema": "sccal.model/1"}'):
        path = tmp_path / "model.json"
        path.write_text(content)
        with pytest.raises(DataError, match=r"model\.json"):
            read_judged_model(path)
