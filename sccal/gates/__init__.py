"""Conditions that results must keep, and whether they do."""
