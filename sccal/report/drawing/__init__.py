"""The one vocabulary of drawing: colours and style, a sheet with panels, and a figure as a plan."""
