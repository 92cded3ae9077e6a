"""The names of a run's files, each spelled here only, and names of runs in the order in which people count."""

from __future__ import annotations

import re
from pathlib import PurePath

ENCODER_FILE, AHRS_FILE, NMEA_FILE, GNSS_FILE = "encoder.csv", "ahrs.csv", "gnss.nmea", "gnss.csv"
VEHICLE_FILE = "vehicle.toml"
BAG_FILE = "metadata.yaml"
"""Tells that a folder is a ROS 2 bag."""

NaturalKey = list[list[tuple[int, int, str]]]


def natural_key(path: PurePath) -> NaturalKey:
    """A key that sorts run2 before run10, part by part."""
    return [
        [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"([0-9]+)", name) if part]
        for name in path.parts
    ]
