"""From the bytes of a log to streams, and back: CSV, NMEA and messages."""
