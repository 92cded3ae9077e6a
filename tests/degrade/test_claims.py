"""A degraded log claims no more than its fixes are worth: what is written is what the reader takes it for."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from sccal.align.accuracy import table_sigma_m
from sccal.degrade.faults import Faults
from sccal.degrade.nmea import degrade_nmea
from sccal.errors import DataError
from sccal.logs.nmea import parse_nmea
from tests.degrade.logs import NOON, clock, gga, place, rmc, sentence

SIGMA_M = 5.0
WORTH_M = 3.0
"""σ per axis of an autonomous fix, the worst that a quality means."""
MODES = "NADPRFEMS"


def gns(t_s: float, modes: str) -> str:
    return sentence(f"GNGNS,{clock(t_s)},{place(52.1, 5.3, 7)},{modes},20,0.60,40.0,45.0,1.0,0000")


def ggk(t_s: float, code: str) -> str:
    return sentence(f"PTNL,GGK,{clock(t_s)},060124,{place(52.1, 5.3, 8)},{code},12,1.9,EHT150.790,M")


def ksxt(t_s: float, code: str) -> str:
    where = "5.30000000,52.10000000"
    return sentence(f"KSXT,20240601{clock(t_s)},{where},68.3830,299.22,67.03,190.28,0.022,,{code},3,46,28,,,,,,")


def rmc_of(t_s: float, mode: str) -> str:
    return rmc(t_s, 52.1, 5.3, mode)


def gga_of(t_s: float, code: str) -> str:
    return sentence(gga(t_s, 52.1, 5.3).replace(",4,12,", f",{code},12,").partition("*")[0][1:])


CLAIMS = [
    *((ggk, str(code)) for code in range(16)),
    *((gns, "".join(letters)) for letters in itertools.product(MODES, repeat=2)),
    *((gns, letters) for letters in ("", "rf", "RFAN", "NNNR", "XR")),
    *((ksxt, code) for code in ("", "0", "1", "2", "3", "4")),
    *((rmc_of, mode) for mode in ("", "X", "r", *MODES)),
    *((gga_of, code) for code in ("", *"0123456789", "10")),
]


@pytest.mark.parametrize(("make", "claim"), CLAIMS)
def test_a_claim_means_the_same_to_who_reads_and_to_who_degrades(make, claim):
    raw = "\n".join(make(NOON + i, claim) for i in range(20)).encode()
    try:
        read, _ = parse_nmea(raw, "gnss.nmea")
    except DataError:
        with pytest.raises(DataError, match="no position fix"):
            degrade_nmea(raw, Faults(sigma_m=SIGMA_M), None, "run")
        return
    done = degrade_nmea(raw, Faults(sigma_m=SIGMA_M), None, "run")
    assert done.epochs.quality.tolist() == read.quality.tolist()
    after, _ = parse_nmea(done.raw, "gnss.nmea")
    sigma_m = table_sigma_m(after.quality)
    assert (after.quality == done.fixes.quality).all()
    assert ((sigma_m >= WORTH_M) | np.isnan(sigma_m) | (after.quality == -1)).all()


@pytest.mark.parametrize(
    ("make", "claim", "fields"), [(gga_of, "4", 13), (rmc_of, "R", 9), (gns, "RR", 10), (ggk, "3", 10), (ksxt, "3", 11)]
)
def test_the_shortest_sentence_that_is_read_is_degraded(make, claim, fields):
    """Without a checksum, its number of fields tells whether a sentence is whole."""
    lines = [make(NOON + i, claim).partition("*")[0].split(",") for i in range(20)]
    address = 2 if make is ggk else 1
    raw = "".join(",".join(line[: address + fields]) + "\n" for line in lines).encode()
    before, _ = parse_nmea(raw, "gnss.nmea")
    after, _ = parse_nmea(degrade_nmea(raw, Faults(sigma_m=SIGMA_M), None, "run").raw, "gnss.nmea")
    assert before.lat_deg.size == after.lat_deg.size == 20
    assert (before.lat_deg != after.lat_deg).all()


@pytest.mark.parametrize(("make", "claim"), [(gns, "RR"), (ggk, "3"), (ksxt, "3")])
@pytest.mark.parametrize("mode", ["", "D"])
def test_the_sentences_that_are_read_decide_what_an_epoch_claims(make, claim, mode):
    """RMC says less about its quality than the others, or nothing, and is read where there is nothing else."""
    raw = "\n".join(line for i in range(20) for line in (rmc_of(NOON + i, mode), make(NOON + i, claim))).encode()
    read, _ = parse_nmea(raw, "gnss.nmea")
    done = degrade_nmea(raw, Faults(sigma_m=1.0), None, "run")
    assert done.epochs.quality.tolist() == read.quality.tolist() == [4] * 20
    after, _ = parse_nmea(done.raw, "gnss.nmea")
    assert (table_sigma_m(after.quality) >= 1.0).all()
