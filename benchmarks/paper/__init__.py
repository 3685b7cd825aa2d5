"""The tables of the paper, measured again: `python -m benchmarks.paper`."""
