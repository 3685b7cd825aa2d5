"""Folders of any size: files classified by many, and what people make of the results.

`sorting` puts files into a folder for each class; `report` is one page to look all of them over.
"""
