"""The paper's experiments: fixes lost, lowered to one metre, lowered to five; with and without the heading offset."""
