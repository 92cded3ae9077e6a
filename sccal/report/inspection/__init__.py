"""What is in a log: text, page, figures."""
