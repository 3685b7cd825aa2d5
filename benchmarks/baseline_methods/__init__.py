"""The methods of `benchmarks.baselines`: what a network has to beat to be worth its trouble.

Each is a frozen dataclass of its settings with one method, `scores(train, test, seed)`.
"""
