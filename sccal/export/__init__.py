"""Written results in the formats of other tools: one module for each format, told apart by the catalogue.

Works on calibration.json, vehicle.json and trajectory.csv only; nothing here calibrates. What was not estimated never
passes as a result: it keeps its nominal value, or stands as a comment, and the catalogue tells it.
"""
