"""Fuzzing of every reader: any bytes give a run, or one line that names the file and a place."""
