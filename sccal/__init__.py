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
errors · arrays · compiled · geodesy · randomness · logs (bytes to streams, and back) · align (streams to one timeline
of events), simulate, degrade and convert (logs with known truth, with a fault, in another format) · effects (one file
each) · filter (the compiled kernel, the noise) · evidence (several runs as one problem, the evidence of any set of
effects) · calibration (one run, several runs, outages, held-out drift) · diagnose (what the model lacks), experiments
(the paper's), inspect (what is in a log) · results (what files hold) · summary, gates, compare, export (work on
results) · report (text, json, yaml, figures, html; computes nothing) · batch, samples · cli (parse, call, print)

The model is that of L. Cantelli, S. Ligama, G. Muscato, D. Spina, "Auto-Calibration Methods of Kinematic Parameters
and Magnetometer Offset for the Localization of a Tracked Mobile Robot", Robotics 2016, 5(4), 23.
"""

__version__ = "0.1.0"
