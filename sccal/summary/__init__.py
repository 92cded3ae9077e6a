"""Many calibrations as one picture: the runs, their paths, and each vehicle's parameters over time.

Everything that the page, the table and the JSON of a batch need is computed here, from what stands in the results'
files. The way in is ``sccal.summary.summarise``.
"""

from sccal.summary.summarise import summarise

__all__ = ["summarise"]
