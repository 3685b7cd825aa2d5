"""The methods of `benchmarks.baselines`: simple methods to compare the network with.

Each is a frozen dataclass of its settings with one method, `scores(train, test, seed)`.
"""
