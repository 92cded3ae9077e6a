"""NMEA logs: what receivers write, as fixes and, where there is no ahrs.csv, as headings.

``sentences``  sentences found in bytes, checked and cut into fields
``times``      the epoch and the date of each
``positions``  positions and their qualities; ``receivers`` keeps those of one receiver
``fixes``      fixes with their sigmas and speeds
``headings``   headings
``read``       all of it, from a file or from bytes
"""

from sccal.logs.nmea.read import parse_nmea, parse_nmea_heading, read_nmea, read_nmea_heading

__all__ = ["parse_nmea", "parse_nmea_heading", "read_nmea", "read_nmea_heading"]
