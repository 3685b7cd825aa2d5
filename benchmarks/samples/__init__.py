"""The generator of the sample meshes in `model/samples`: `python -m benchmarks.samples`."""
