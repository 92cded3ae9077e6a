"""Timings of what a user waits for. Absolute figures belong to one machine; ratios are measured side by side."""
