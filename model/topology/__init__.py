"""The topology stage: everything about a mesh that the network reads as an index.

`halfedges` pairs the edges, `patches` walks neighbourhoods, `pooling` collapses faces, `surface`
is one pooling level of one mesh and `levels` all of them, `ragged` joins the meshes of a batch.
"""

from meshconv3d.model.topology.levels import Topology, build_topology
from meshconv3d.model.topology.surface import Surface, TopologyOptions

__all__ = ["Surface", "Topology", "TopologyOptions", "build_topology"]
