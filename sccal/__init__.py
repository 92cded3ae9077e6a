"""sccal: calibrated wheel radii, track width and heading offset from a field robot's own logs.

Conventions, valid everywhere in this package
---------------------------------------------
* Plane: east-north of a local tangent frame (never UTM, whose scale of 0.9996 is a 0.04 % radius error and whose
  convergence is a heading error). Heading θ is counter-clockwise from east.
* Robot frame: forward, left. The robot's position is the middle between the two wheels (or tracks).
* Units: SI and radians inside; degrees only in files, command-line text and reports. A name carries its unit
  (``track_m``, ``t_s``, ``yaw_rad``); textbook letters appear only where a docstring's equation uses them.
* Time: seconds on the logging computer's clock.
* Innovation: ν = z − h(x), measured minus predicted.
* Heading offset: what the AHRS reads, turned into enu, minus the robot's heading.

Rooms, ground floor first; imports point down only
--------------------------------------------------
0   errors       Every failure that a user can act on, as one line and one exit code.
0   arrays       The names of the array types.
0   compiled     Compilation to machine code, with a cache that cannot go stale.
1   geodesy      The local tangent plane: latitude and longitude to metres, and back.
1   randomness   Named streams of random numbers, and the errors made of them.
1   processes    Work in processes of this machine, replaced where the system kills one.
1   logs         From the bytes of a log to streams, and back.
2   results      Every type of result, and the one way of writing and reading them.
3   align        From streams to one timeline of events on one clock.
3   convert      Runs from one form of log into another.
3   simulate     A robot that never was, and the logs that it would have written.
3   degrade      Existing logs rewritten with a fault, everything else byte for byte as it was.
4   effects      What a real robot may have that the paper's model lacks, one file each.
5   filter       The compiled filter, where it starts, and the noise that it assumes.
6   evidence     Several runs as one problem, and what the data say of any set of effects.
7   calibration  The constants of one run and of several, their statuses, and the outages that judge them.
8   diagnose     The search for what the model lacks, judged before and after.
8   experiments  The paper's experiments, with simulated drives and with one's own.
8   inspect      What is in a log, before anything is estimated.
9   propose      What a user's own files hold, found by names and checked by numbers, as a vehicle.toml.
9   summary      Many calibrations as one picture.
9   gates        Conditions that results must keep, and whether they do.
9   compare      What changed between two results beyond its uncertainty.
9   export       Results in the formats of other tools.
10  report       Results as text, JSON, YAML, figures and pages; nothing is computed there.
11  batch        Many runs in one call, none stopped by another's failure.
11  samples      The sample logs, the same bytes every time.
12  cli          The command line: parse, call, print, exit code.

The model is that of L. Cantelli, S. Ligama, G. Muscato, D. Spina, "Auto-Calibration Methods of Kinematic Parameters
and Magnetometer Offset for the Localization of a Tracked Mobile Robot", Robotics 2016, 5(4), 23.
"""

__version__ = "0.1.0"
