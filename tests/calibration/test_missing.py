"""A quick look for what the model lacks: silent on a good log, and right where much is missing."""

from __future__ import annotations

import numpy as np

from sccal.calibration.missing import STRONG_NATS, look_for_missing
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.effects.catalogue import CATALOGUE, parse_effect
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, refitted
from sccal.filter.iterate import reported_values
from tests.evidence.logs import HEADING_HZ, bare, write_log
from tests.runs import read


def missing_in(*texts, path="general"):
    model = bare(*texts, path=path)
    return look_for_missing(model.problems[0], reported_values(model.path(0)), HEADING_HZ)


def test_a_clean_log_lacks_nothing():
    assert missing_in() == ()
    assert missing_in(path="rectangle") == ()


def test_an_arm_of_40_cm_is_named():
    (one, *more) = missing_in("lever_arm=0.4,0")
    assert one.effect == "lever_arm"
    assert one.evidence_nats > 100.0 > STRONG_NATS
    assert one.size > 5.0
    assert [other.evidence_nats for other in (one, *more)] == sorted(
        (other.evidence_nats for other in (one, *more)), reverse=True
    )
    assert all(other.evidence_nats >= STRONG_NATS and other.size >= 1.0 for other in more)


def test_what_is_in_the_model_already_is_not_missing():
    model = refitted(bare("lever_arm=0.4,0"), [Accepted(Free(CATALOGUE["lever_arm"]))])
    values = reported_values(model.path(0))
    assert np.abs(values[4] - 0.4) < 0.05
    assert look_for_missing(model.problems[0], values, HEADING_HZ) == ()


def test_a_calibration_tells_it(tmp_path):
    effect, values = parse_effect("lever_arm=0.4,0")
    write_log(tmp_path, [effect.physics(values)])
    calibration, _ = calibrate_run(read(tmp_path), CalibrationOptions())
    assert calibration.missing[0].effect == "lever_arm"
