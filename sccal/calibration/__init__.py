"""From an aligned run to calibrated constants: one run, several runs of one vehicle, and outages to judge them by."""
