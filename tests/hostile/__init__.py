"""Files that are made to do harm: each with the name that it declares and what must come of it."""

from tests.hostile import amf, gltf, obj, off, others, ply, stl, threemf
from tests.hostile.catalogue import HostileFile

HOSTILE: dict[str, HostileFile] = {
    f"{room.__name__.rpartition('.')[2]}: {title}": file
    for room in (obj, off, stl, ply, gltf, threemf, amf, others)
    for title, file in room.FILES.items()
}

__all__ = ["HOSTILE", "HostileFile"]
