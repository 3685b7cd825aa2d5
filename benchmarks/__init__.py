"""Measurements: `python -m benchmarks`; those that need data, `python -m benchmarks.NAME DATA`."""
