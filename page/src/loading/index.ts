// From the bytes of a file to its triangles, as `model.loading` reads them.

import { OBJLoader } from "three/examples/jsm/loaders/OBJLoader.js";
import { PLYLoader } from "three/examples/jsm/loaders/PLYLoader.js";
import { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";
import { MeshError, type Mesh } from "../mesh";
import { extensionOf } from "../parsing/formats";
import { readGltf } from "../parsing/gltf";
import { soupOf, soupOfGeometry, type Soup } from "../parsing/soup";

const text = (data: ArrayBuffer) => new TextDecoder().decode(data);

const READERS: Record<string, ((data: ArrayBuffer) => Soup | Promise<Soup>) | undefined> = {
  obj: (data) => soupOf(new OBJLoader().parse(text(data))),
  stl: (data) => soupOfGeometry(new STLLoader().parse(data)),
  ply: (data) => soupOfGeometry(new PLYLoader().parse(data)),
  glb: readGltf,
  gltf: readGltf,
};

/** All triangles of a mesh file, nothing welded or cleaned. Throws MeshError. */
export async function load(name: string, data: ArrayBuffer): Promise<Mesh> {
  const reader = READERS[extensionOf(name)];
  if (!reader) {
    throw new MeshError(
      "unknown-format",
      `${name} is of a format that is not read in the browser (which reads ` +
        `${Object.keys(READERS).join(", ")}); the service reads more`,
    );
  }
  const { positions } = await reader(data);
  return { vertices: positions, faces: Int32Array.from({ length: positions.length / 3 }, (_, i) => i) };
}
