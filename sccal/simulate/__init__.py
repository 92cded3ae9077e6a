"""A robot that never was, and the logs it would have written.

Three stages, each with its own module, so that a real effect can be made to happen exactly where it happens:

    paths     what the robot is asked to do: speed and turn rate over time
    world     what is true: the body's motion, the wheels' travel, the wheels' angles
    sensors   what is logged: ticks, AHRS readings and fixes, on their own clocks

``settings`` says everything that can be chosen, ``physics`` is the place to hook a further effect into a stage, ``run``
puts the stages together (``simulate_run``), and ``files`` writes a run's folder (``write_run``, ``write_samples``).
"""
