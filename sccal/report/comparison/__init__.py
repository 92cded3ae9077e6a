"""Two results compared: text."""
