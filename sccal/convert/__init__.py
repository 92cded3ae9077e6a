"""Runs from one form of log into another: folders of CSV and NMEA, and MCAP files that Foxglove and PlotJuggler open.

``tables``          a run as the tables and lines of its files, before any repair: what both forms hold
``from_folder``     a run's folder as tables; ``from_messages`` a log of messages
``to_mcap``         tables as an MCAP file; ``to_folder`` as a folder
``paths``           all runs of one call
"""
