"""Batch: any number of files classified into one output, in bounded memory.

`listing` finds the `files`, `running` classifies them on this machine and `ray_engine` on a
cluster. `outputs` keeps the records and `resume` goes on with them after an interruption. `sort`
and `report` make side outputs: the files in folders by class, and one page to look all over.
"""
