"""A diagnosis: text, page, figures."""
