"""The paper's experiments: text, page, figures."""
