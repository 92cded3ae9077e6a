"""One run: text, page, PDF, figures, and the files of its path."""
