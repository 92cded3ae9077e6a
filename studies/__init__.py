"""Studies that judge sccal from outside: an own simulator in plain numpy, and three questions asked of many logs.

Nothing here reads the effects, the filter or the simulator of the package under test. What an effect is comes from the
published description of its parameters and is injected here as physics, so that an error of a column cannot hide in
the log that should show it. `studies/sccal_adapter.py` is the only file that calls sccal.

    python -m studies noise      is the noise found, and is nothing named where nothing is?
    python -m studies effects    is what is there named, once, with an honest sigma?
    python -m studies parking    does a robot that stands for long keep its constants?
    python -m studies field      do logs as people really write them end as they ought to?
    python -m studies log DIR    writes one log, with any effects, beside its truth.json
"""
