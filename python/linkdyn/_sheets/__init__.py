"""Sheets of runs and sweeps, as HTML and PDF."""
