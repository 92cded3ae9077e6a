"""Results as their files tell them, for whatever works on what was calibrated before."""
