"""The paper's tables, measured again: `python -m benchmarks.paper`.

`accuracy` trains and scores what Tables I and II compare, `cost` measures Table III, and `tables`
sets the results beside the paper's figures, as `docs/paper.md` shows them.
"""
