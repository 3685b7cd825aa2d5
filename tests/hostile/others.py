"""Files that are none of the formats, or whose names lie."""

import gzip
import tarfile
from io import BytesIO

from tests.hostile.catalogue import Catalogue
from tests.model.loading import loading_builders as build

FILES = Catalogue("box.obj")


def _tar() -> bytes:
    stream = BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as archive:
        member = tarfile.TarInfo("../../box.obj")
        member.size = 4
        archive.addfile(member, BytesIO(b"v 1\n"))
    return stream.getvalue()


_COLLADA = b'<?xml version="1.0"?><COLLADA version="1.4.1"><library_nodes/></COLLADA>'
_PICTURE = b"\x89PNG\r\n\x1a\n" + b"\xab" * 200

FILES.add("no bytes", b"", "empty-file")
for _name in ("box.dxf", "box.xaml", "box.tar.gz", "box", "obj."):
    FILES.add(f"the name {_name}", build.obj(), "unknown-format", _name)
for _name in ("box.dae", "box.step", "box.fbx", "box.usdz", "box.amf"):
    FILES.add(f"OBJ called {_name}", build.obj(), "format-mismatch", _name)
FILES.add("a name of 100 kB", build.obj(), "unknown-format", "box." + "x" * 100_000)
FILES.add("a name with a zero byte", build.obj(), "unknown-format", "box.obj\0.png")
FILES.add("a name of another folder", build.obj(), None, "../../../../etc/passwd.obj")
FILES.add("a name at an address", build.obj(), None, "http://127.0.0.1:9/box.obj")
FILES.add("COLLADA called OBJ", _COLLADA, "format-mismatch")
FILES.add("COLLADA called 3MF", _COLLADA, "format-mismatch", "box.3mf")
FILES.add("a box called a zip", build.obj(), "format-mismatch", "box.zip")
FILES.add("a zip called STL", build.threemf(), "format-mismatch", "box.stl")
FILES.add("gzip called STL", gzip.compress(build.stl_binary()), "truncated", "box.stl")
FILES.add("tar called OFF", _tar, "not-text", "box.off")
FILES.add("a picture called STL", _PICTURE, "truncated", "box.stl")
FILES.add("a picture called GLB", _PICTURE, "format-mismatch", "box.glb")
FILES.add("GLB called OBJ", build.glb(), "format-mismatch")
FILES.add("a binary STL called PLY", build.stl_binary(b"ply\n"), "format-mismatch", "box.ply")
FILES.add("zeros", bytes(1000), "no-faces")
FILES.add("all ones", b"\xff" * 400, "no-faces")
