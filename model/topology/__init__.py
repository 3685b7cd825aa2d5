"""Topology stage: the indices and descriptors of a mesh that the network takes as input.

`halfedges` pairs edges and grows patches, `pooling` collapses faces, `surface` has the levels of
one mesh, `batch` those of several. `geometry` measures triangles; `descriptors` and
`integral_invariants` compute the features of each face; `inputs` collects all arrays of a mesh.
"""

from meshconv3d.model.topology.surface import Surface, Topology, TopologyOptions, build_topology

__all__ = ["Surface", "Topology", "TopologyOptions", "build_topology"]
