"""Results as a reader wants them: text, JSON, trajectories, YAML, figures and pages. Computes nothing.

Values are only rounded, converted to display units and laid out. ``text`` imports neither matplotlib nor jinja2;
``write`` imports them when a page is asked for.
"""
