"""The generator of the meshes in `tests/articulated`: `python -m benchmarks.samples`."""
