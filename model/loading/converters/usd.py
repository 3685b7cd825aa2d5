"""USD to polygons by Pixar's library: the meshes that a stage shows at its first time."""

# pxr fills its modules when it is imported.
# pyright: reportAttributeAccessIssue=false

import posixpath
import sys
import zipfile
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom

_MOST = 250_000  # prims and instances
_DEEPEST = 10  # instancers within instancers
_LAYERS = (".usd", ".usda", ".usdc")
_CLIPS = ("clips", "clipAssetPaths", "clipTemplateAssetPath", "clipManifestAssetPath")
_SHAPES = (  # beside meshes
    *(UsdGeom.Cube, UsdGeom.Sphere, UsdGeom.Cylinder, UsdGeom.Cone, UsdGeom.Capsule),
    *(UsdGeom.Plane, UsdGeom.NurbsPatch, UsdGeom.TetMesh),
)


def read(path: Path) -> tuple:
    """Meshes, which of them are shown, and the matrices that place these."""
    is_package = path.read_bytes()[:2] == b"PK"
    path = path.rename(path.with_suffix(".usdz" if is_package else ".usd"))
    _check_references(path)
    scene = _Scene(Usd.Stage.Open(str(path)))
    return scene.meshes, scene.shown, scene.matrices


def _check_references(path: Path) -> None:
    """Ends the program where a layer refers to files that are not within the package."""
    names = [""]
    if path.suffix == ".usdz":
        names = [
            name for name in zipfile.ZipFile(path).namelist() if name.lower().endswith(_LAYERS)
        ]
    for name in names:
        layer = Sdf.Layer.FindOrOpen(f"{path}[{name}]" if name else str(path))
        for reference in layer.GetCompositionAssetDependencies():
            beside = posixpath.normpath(posixpath.join(posixpath.dirname(name), reference))
            if reference and beside not in names:
                sys.exit(f"the file refers to another, {reference[:100]!r}: pack both as .usdz")

        def check(spec: Sdf.Path, layer: Sdf.Layer = layer) -> None:
            prim = layer.GetPrimAtPath(spec) if spec.IsPrimPath() else None
            if prim and any(map(prim.HasInfo, _CLIPS)):
                sys.exit("the file has value clips, which are not read; export it without")

        layer.Traverse(Sdf.Path.absoluteRootPath, check)


class _Scene:
    """Meshes that a stage shows. USD's matrices are of row vectors: what is inner comes first."""

    def __init__(self, stage: Usd.Stage) -> None:
        self.meshes, self.shown, self.matrices = [], [], []
        has_times = stage.HasAuthoredTimeCodeRange()
        self._time = (
            Usd.TimeCode(stage.GetStartTimeCode()) if has_times else Usd.TimeCode.EarliestTime()
        )
        self._transforms = UsdGeom.XformCache(self._time)
        self._numbers: dict[Sdf.Path, int] = {}  # of meshes
        self._count = 0
        self._add(stage.GetPseudoRoot(), np.eye(4)[None], 0)

    def _add(self, root: Usd.Prim, where: np.ndarray, depth: int) -> None:
        """Add what a prim and those below show, at the places of that prim (N x 4 x 4)."""
        if depth > _DEEPEST:
            sys.exit(f"instancers are nested more than {_DEEPEST} deep")
        prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies()))
        for prim in prims:
            self._bound(1)
            drawn = UsdGeom.Imageable(prim)
            if drawn and not self._is_shown(drawn):
                prims.PruneChildren()
                continue
            local, _ = self._transforms.ComputeRelativeTransform(prim, root)
            within = np.array(local) @ where
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
                self._add_instances(UsdGeom.PointInstancer(prim), within, depth)
            elif prim.IsA(UsdGeom.Mesh):
                self._add_mesh(prim, within)
            elif any(map(prim.IsA, _SHAPES)):
                sys.exit(f"the file shows a {prim.GetTypeName()}; export it as a mesh")

    def _is_shown(self, prim: UsdGeom.Imageable) -> bool:
        visible = prim.GetVisibilityAttr().Get(self._time) != UsdGeom.Tokens.invisible
        return visible and prim.ComputePurpose() in ("default", "render")

    def _add_instances(
        self, instancer: UsdGeom.PointInstancer, where: np.ndarray, depth: int
    ) -> None:
        """Add the prototypes of an instancer, where it places them."""
        kinds = np.array(instancer.GetProtoIndicesAttr().Get(self._time), dtype=np.int64)
        mask = np.array(instancer.ComputeMaskAtTime(self._time), dtype=bool)
        kinds = kinds[mask] if len(mask) else kinds
        places = instancer.ComputeInstanceTransformsAtTime(self._time, self._time)
        places = np.array(places).reshape(-1, 4, 4)
        for kind, path in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
            inner = places[kinds == kind]
            self._bound(len(inner) * len(where))
            if len(inner):
                prim = instancer.GetPrim().GetStage().GetPrimAtPath(path)
                self._add(prim, (inner[:, None] @ where).reshape(-1, 4, 4), depth + 1)

    def _add_mesh(self, prim: Usd.Prim, where: np.ndarray) -> None:
        """Add a mesh at some places; that of a prototype is kept once."""
        self._bound(len(where))
        own = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        if own.GetPath() not in self._numbers:
            self._numbers[own.GetPath()] = len(self.meshes)
            self.meshes.append(self._polygons(UsdGeom.Mesh(own)))
        self.shown += len(where) * [self._numbers[own.GetPath()]]
        self.matrices += list(where.swapaxes(1, 2))

    def _polygons(self, mesh: UsdGeom.Mesh) -> tuple:
        """Vertices, corners and counts."""

        def array(attribute: Usd.Attribute, dtype: type) -> np.ndarray:
            value = attribute.Get(self._time)
            return np.array([] if value is None else value, dtype=dtype)

        corners = array(mesh.GetFaceVertexIndicesAttr(), np.int64)
        counts = array(mesh.GetFaceVertexCountsAttr(), np.int64)
        kept = np.ones(len(counts), dtype=bool)
        kept[array(mesh.GetHoleIndicesAttr(), np.int64)] = False
        corners, counts = corners[np.repeat(kept, counts)], counts[kept]
        if mesh.GetOrientationAttr().Get(self._time) == UsdGeom.Tokens.leftHanded:
            corners, counts = corners[::-1], counts[::-1]
        return array(mesh.GetPointsAttr(), np.float64).reshape(-1, 3), corners, counts

    def _bound(self, more: int) -> None:
        """Ends the program where prims and instances become too many."""
        self._count += more
        if self._count > _MOST:
            sys.exit(f"the file places more than {_MOST} parts")
