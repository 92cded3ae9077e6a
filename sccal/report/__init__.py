"""Results as a reader wants them: text, JSON, trajectories, YAML, figures and pages. Computes nothing.

A package for each subject, with its text, its page and its figures, and these for all of them:

    drawing      colours and style, a sheet with panels, a figure as a plan
    layout       plain text in paragraphs and columns      rows, sentences      what is said the same everywhere
    page         the frame of the pages                    write                every file of every result

Values are only rounded, converted to display units and laid out. No text loads matplotlib or jinja2; ``write`` loads
them when a page is asked for.
"""
