"""Files of any number are classified with memory that does not grow with them.

`listing` says which files, one by one; `local` and `remote` know what a file is here and elsewhere.
`classifying` makes the outcome of one, `engines` those of all. `outputs` keeps them where
`targets` says: in `journals` so that nothing is lost, with `resuming` so that nothing is done
twice, and in `tables` for people. `uses` has what is made of them beside: `sorting` puts the files
themselves into a folder for each class, and `report` is one page to look all of them over. None of
it knows of the command line.
"""
