"""Write the sample meshes of the package: `python -m benchmarks.open_data.samples DATA`.

DATA has open_objects.tar.xz and open_parts.tar.xz with their tables. samples.csv names the meshes,
all of them CC0, and the file that each becomes. The same data gives the same files.
"""

import argparse
import tarfile
from pathlib import Path

import meshconv3d.model.samples
from benchmarks.open_data.curation import SETS, TABLES, read_table
from benchmarks.samples.__main__ import encode
from benchmarks.workloads import amf, as_file
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh

SAMPLES = Path(meshconv3d.model.samples.__file__).parent
SOURCES = """# Sources of the sample meshes

All are CC0: their authors have given up all rights, and are named with thanks.

| file | author | from |
| --- | --- | --- |
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path, help="folder of the archives and their tables")
    data = parser.parse_args().data
    wanted = read_table(TABLES / "samples.csv")
    text = SOURCES
    for name, archive in SETS.items():
        chosen = {
            f"{archive}/{r['folder']}/{r['file']}": r["sample"] for r in wanted if r["set"] == name
        }
        for row in read_table(data / f"{archive}.csv"):
            sample = chosen.get(f"{archive}/{row['class']}/{row['file']}")
            if sample and row["licence"] != "CC0":
                parser.error(f"{row['file']} is {row['licence']}, not CC0")
            if sample:
                path = row["path"].replace("|", "/")
                text += f"| {sample} | {row['author']} | {row['repo']}, {path} |\n"
        with tarfile.open(data / f"{archive}.tar.xz") as tar:
            for member in tar:
                content = tar.extractfile(member) if member.name in chosen else None
                if content is not None:
                    sample = chosen[member.name]
                    mesh = load_mesh(content.read(), "ply")
                    (SAMPLES / sample).write_bytes(written(mesh, sample))
    (SAMPLES / "SOURCES.md").write_text(text, encoding="utf-8")


def written(mesh: Mesh, name: str) -> bytes:
    """The mesh as a file of the format that the name ends with; text has five digits."""
    form = Path(name).suffix[1:]
    if form == "gltf":
        return as_file(mesh, form)
    if form == "amf":
        return amf(mesh, digits=5).encode()
    return encode(mesh.moved(mesh.vertices.round(5) + 0.0), form)


if __name__ == "__main__":
    main()
