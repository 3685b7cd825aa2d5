"""MeshConv3D: what is this 3D mesh?

The one name that is installed. Its folders `model`, `export` and `service` are links to the
folders of the repository, which stay where they are; a wheel holds the files themselves.
"""
