"""Several runs of one vehicle: text, page, figures."""
