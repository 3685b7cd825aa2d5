"""The topology stage: everything about a mesh that the network reads as an index or a descriptor.

`halfedges` pairs edges and walks patches, `pooling` collapses faces, `surface` is the levels of one
mesh, `batch` those of several. `geometry` measures triangles; `descriptors` and
`integral_invariants` are what the network reads of each face; `inputs` puts all together.
"""

from meshconv3d.model.topology.surface import Surface, Topology, TopologyOptions, build_topology

__all__ = ["Surface", "Topology", "TopologyOptions", "build_topology"]
