"""Logs made worse on purpose: what is asked for (``faults``), and existing files rewritten with it, byte by byte.

``faults``   the faults, and what they do to fixes and to the streams of a read run
``nmea``     NMEA logs; ``edits`` cuts new text into a buffer
``tables``   CSV files: gnss.csv, ahrs.csv, encoder.csv
``folder``   a run's folder, its copy and its manifest
``mcap``     an MCAP file: ``mcap_faults`` says which messages change and how, ``mcap_patch`` changes one,
             ``mcap_records`` writes the file again
``paths``    all runs of one call
"""
