"""Curation of the openly licensed data sets that the shipped models learn from.

The data comes as `NAME.tar.xz` and `NAME.csv` for the sets open_objects and open_parts, with one
row a mesh: the folder it lies in (column `class`), its split, source, licence and author. What is
made of it is said by tables, one folder a set:

    folders.csv   folder,fine_class,class,reason   the class of a folder, or of a part of it; none:
                                                   left out
    moves.csv     folder,file,class,reason         single files whose picture shows something else
    drops.csv     folder,file,reason               single files left out
    classes.csv   class,use,few_shot,unknown,note  `trained`, or `held_out`: never trained on, to
                                                   measure learning from few examples (few_shot)
                                                   and the answer "unknown" (unknown)
    near_duplicates.csv  class,file,split,twin,distance
                                                   meshes to measure on with a twin to train on
    objects69.csv objects69,class                  which answers are right for the older data set

Files were judged by their picture, in all splits by the same rules and without any model's answers.
Left out are files that show several things, fragments, ruins, and shapes that only their texture
names: crossed picture cards, plain boxes and bars called a building or a column.
`sources.csv` and `licences.csv` name the packs and the licences; `samples.csv` lists CC0 meshes
that are fit to be shown, none of them trained on except the nut.

Twins are pairs of one class whose surfaces have nearly the same distribution of distances, between
20 000 pairs of points and from the centroid: most are one model in two colours, in two editions of
a pack, or next to each other in a size table. Splits are left as they are.

`python -m benchmarks.open_data DATA OUT` applies the tables.
"""
