"""Files of any number are classified with memory that does not grow with them.

`listing` says which files, one by one, and `entries` and `remote` what a file is here and
elsewhere. `classifying` makes the outcome of one, `engines` those of all. `outputs` keeps them:
`journals` so that nothing is lost, `resuming` so that nothing is done twice, `tables` for people.
None of it knows of the command line.
"""
