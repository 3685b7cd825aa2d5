"""The page without a server: a folder for any web host, in which browsers classify by themselves.

The page is that of the service (`service/page`). Beside it lie whole pipelines in ONNX, the
runtime for them, and in JSON what the service would say of its models. Needs onnx, of the extra
`teach`.
"""

import hashlib
import json
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import onnx
from onnx import TensorProto, helper

from meshconv3d.export.whole import export_whole
from meshconv3d.model.errors import Error
from meshconv3d.model.loading import TABLE, Limits, load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.samples import sample_paths
from meshconv3d.service.http.app import PAGE_POLICY
from meshconv3d.service.models import ModelFile

if TYPE_CHECKING:
    from meshconv3d.service.library import Library

PAGE = Path(__file__).parent / "page"
# Names the description of the build, in the page's head.
MARK = "meshconv3d-build"
# That of the service, but for frames, which a page cannot forbid, and for the runtime.
POLICY = "; ".join(
    f"{rule} 'wasm-unsafe-eval'" if rule.startswith("script-src") else rule for rule in PAGE_POLICY
)
# Folders of a build; what an earlier one has left in them goes.
FOLDERS = ("assets", "library", "models", "samples")


class NotWritten(Error):
    """Error of a folder that a build cannot be written into."""


def check_folder(folder: Path) -> None:
    """Raises NotWritten unless the folder can be made, is empty, or holds a build."""
    index = folder / "index.html"
    if not folder.exists():
        if not folder.parent.is_dir():
            raise NotWritten(f"{folder}: there is no folder {folder.parent}")
    elif not folder.is_dir():
        raise NotWritten(f"{folder} is a file; name a folder")
    elif any(folder.iterdir()) and not (
        index.is_file() and MARK in index.read_text("utf-8", errors="replace")
    ):
        raise NotWritten(f"{folder} is not empty, and holds no such page; name another folder")


def write_page(
    folder: Path, models: Sequence[ModelFile], library: "Library | None" = None
) -> dict[str, int]:
    """Write a build into a folder that `check_folder` has passed; one that it holds is replaced.

    models: with different names, the default first. Returns the bytes of each file by its path in
    the folder. Raises ModelFileError, ParityError and OSError.
    """
    with TemporaryDirectory(prefix="meshconv3d-") as scratch:
        build = _Build(Path(scratch))
        build.write(models, library)
        return _put(build.folder, folder)


class _Build:
    """A build that is made in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.versions: list[str] = []

    def write(self, models: Sequence[ModelFile], library: "Library | None") -> None:
        shutil.copytree(
            PAGE, self.folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("docs*")
        )
        assets = [f"assets/{path.name}" for path in sorted(self.folder.glob("assets/*"))]
        samples = [
            {"name": name, "file": path.name, **self.add(f"samples/{path.name}", path.read_bytes())}
            for name, path in sample_paths().items()
        ]
        runtime = self.folder / "onnxruntime.bin"
        description = {
            "runtime": self.add(runtime.name, runtime.read_bytes()),
            "models": list(self.add_models(models)),
            "samples": samples,
            "formats": [asdict(known.row) for known in TABLE.values() if known.library is None],
            "limits": {"upload_bytes": 100 * 2**20, **asdict(Limits())},
            "library": library and self.add_library(library),
        }
        described = self.add("build.json", json.dumps(description).encode())["path"]
        shell = [*assets, *(sample["path"] for sample in samples), described]
        self.prepend(
            "service-worker.js",
            f"const build = {json.dumps({'shell': shell, 'versions': self.versions})};\n",
        )
        index = self.folder / "index.html"
        head, end, rest = index.read_text("utf-8").partition('<meta charset="utf-8" />')
        added = f'<meta http-equiv="Content-Security-Policy" content="{POLICY}" />'
        marked = f'<meta name="{MARK}" content="{described}" />'
        index.write_text("\n    ".join([head + end, added, marked]) + rest, "utf-8")

    def add(self, path: str, content: bytes) -> dict[str, Any]:
        """Write a file. Returns its address, which changes with its content, and its bytes."""
        file = self.folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
        version = hashlib.sha256(content).hexdigest()[:16]
        self.versions.append(version)
        return {"path": f"{path}?v={version}", "bytes": len(content)}

    def add_models(self, models: Sequence[ModelFile]) -> Iterator[dict[str, Any]]:
        """Write each model as a whole pipeline. Yields what the page knows of it."""
        samples = {name: load_mesh(path) for name, path in sample_paths().items()}
        for model in models:
            opened = model.open()
            budget = opened.card.config.face_budget
            meshes = {name: prepare(mesh, budget)[0] for name, mesh in samples.items()}
            content = whole_with_pools(onnx.load_model_from_string(model.content), meshes)
            written = self.add(f"models/{opened.card.name}.onnx", content)
            yield opened.to_dict() | written | {"sha256": hashlib.sha256(content).hexdigest()}

    def add_library(self, library: "Library") -> dict[str, Any]:
        """Write embeddings, entries and pictures. Returns what the page knows of them."""
        entries = []
        for row, picture in enumerate(library.pictures(range(len(library)))):
            path = f"library/pictures/{row}.png"
            entries.append(
                {name: library.value(name, row) for name in ("file", "class", "unknown")}
                | {"picture": picture and self.add(path, picture)["path"]}
            )
        embeddings = library.embeddings.astype("<f4").tobytes()
        return {
            "meshes": len(library),
            "model": library.card.name,
            "embeddings": self.add("library/embeddings.bin", embeddings),
            "entries": self.add("library/entries.json", json.dumps(entries).encode()),
        }

    def prepend(self, name: str, text: str) -> None:
        file = self.folder / name
        file.write_text(text + file.read_text("utf-8"), "utf-8")


def whole_with_pools(model: onnx.ModelProto, meshes: dict[str, Mesh]) -> bytes:
    """The whole pipeline of a model file, or itself if it is one, with the pooling indices as
    further outputs: evidence is distributed over the faces of a mesh by them.

    meshes: prepared, to compare on.
    """
    if [value.name for value in model.graph.input] != ["vertices", "faces"]:
        with TemporaryDirectory(prefix="meshconv3d-") as scratch:
            path = Path(scratch) / "whole.onnx"
            export_whole(model, path, meshes)
            model = onnx.load(path)
    given = {value.name for value in model.graph.output}
    for node in model.graph.node:
        for name in node.output:
            if name.startswith("whole.pools_") and name not in given:
                output = helper.make_tensor_value_info(name, TensorProto.INT32, [None, None])
                model.graph.output.append(output)
    return model.SerializeToString()


def _put(made: Path, folder: Path) -> dict[str, int]:
    """Copy a build into its folder, the page last, and remove what is left of another one."""
    paths = sorted(path for path in made.rglob("*") if path.is_file())
    paths.sort(key=lambda path: path.name == "index.html")
    sizes = {path.relative_to(made).as_posix(): path.stat().st_size for path in paths}
    folder.mkdir(exist_ok=True)
    for path in sizes:
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(made / path, target)
    for name in FOLDERS:
        for path in (folder / name).rglob("*"):
            if path.is_file() and path.relative_to(folder).as_posix() not in sizes:
                path.unlink()
    return sizes
