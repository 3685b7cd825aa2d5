"""Measurements, each repeatable with one command: `python -m benchmarks.NAME`."""
