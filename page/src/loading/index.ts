// From the bytes of a file to its triangles, as `model.loading` reads them: the triangles of a whole
// file, and nothing else that it holds. Nothing outside the given bytes is ever opened.

import { MeshError, type Mesh } from "../mesh";
import { extensionOf } from "../parsing/formats";
import { unzip } from "../parsing/unzip";
import { readAmf } from "./amf";
import { isZip } from "./archive";
import { readGltf, type Pieces } from "./gltf";
import { readObj } from "./obj";
import { readOff } from "./off";
import { readPly } from "./ply";
import { isExactBinary, readStl } from "./stl";
import { decoded, isWide } from "./text";
import { read3mf } from "./threemf";

interface Format {
  title: string;
  read: (data: Uint8Array, pieces?: Pieces) => Mesh;
}

/** Formats by their extensions. */
const FORMATS: Record<string, Format | undefined> = {
  obj: { title: "Wavefront OBJ", read: readObj },
  off: { title: "Object File Format", read: readOff },
  stl: { title: "STL", read: readStl },
  ply: { title: "Stanford PLY", read: readPly },
  glb: { title: "binary glTF", read: readGltf },
  gltf: { title: "glTF", read: readGltf },
  "3mf": { title: "3MF", read: read3mf },
  amf: { title: "AMF", read: readAmf },
};
// Formats whose first bytes are fixed: what begins otherwise is not one of them.
const MARKED = ["ply", "glb", "gltf", "3mf", "amf"];

/** The extensions that are read. */
export const EXTENSIONS = Object.keys(FORMATS);

/** All triangles of a mesh file, nothing welded or cleaned. name: declares its format. pieces: the files
 * in which a .gltf keeps its buffers. Throws MeshError, whatever the bytes are. */
export async function load(name: string, data: ArrayBuffer, pieces?: Pieces): Promise<Mesh> {
  const extension = extensionOf(name);
  if (extension === "zip") throw withoutMesh(data);
  const format = FORMATS[extension];
  if (!format) {
    throw new MeshError(
      "unknown-format",
      `'${name}' is of a format that is not read in the browser, which reads ${EXTENSIONS.join(", ")}; ` +
        "convert the mesh to one of these, or use meshconv3d classify, which reads more",
    );
  }
  const bytes = asUtf8(new Uint8Array(data));
  if (!bytes.length) throw new MeshError("empty-file", "the file is empty (0 bytes); export it again");
  const content = sniff(bytes, extension);
  if (content !== extension && (content || MARKED.includes(extension))) {
    const found = content
      ? `is ${FORMATS[content]?.title ?? "a ZIP archive"} (${content})`
      : "is something else";
    throw new MeshError(
      "format-mismatch",
      `the file is declared as ${extension} ('${name}'), but its content ${found}; ` +
        "correct the file name, or export the mesh again",
    );
  }
  try {
    return format.read(bytes, pieces);
  } catch (error) {
    if (error instanceof MeshError) throw error;
    // Damaged bytes can make the libraries underneath raise nearly anything.
    throw new MeshError(
      "unreadable",
      `the file cannot be read as ${format.title}; it is damaged or was written wrongly, export it again`,
    );
  }
}

/** The error of a ZIP archive that was not unpacked into meshes (`files`). */
function withoutMesh(data: ArrayBuffer): MeshError {
  unzip(data); // throws where that is the reason
  return new MeshError(
    "no-meshes",
    "the ZIP archive holds no file of a format that is read in the browser, which reads " +
      `${EXTENSIONS.join(", ")}; archives within it are not opened`,
  );
}

/** The same text in UTF-8, where it was in UTF-16. The header of a binary STL may begin with any bytes. */
const asUtf8 = (data: Uint8Array) =>
  isWide(data) && !isExactBinary(data) ? new TextEncoder().encode(decoded(data)) : data;

const SNIFFED = 2 ** 20; // bytes

/** The extension of the format that the content is certainly in, or null. */
function sniff(data: Uint8Array, declared: string): string | null {
  // First, since the 80 bytes of a binary STL's header may spell anything.
  if (isExactBinary(data)) return "stl";
  if (isZip(data)) return ["3mf", "amf"].includes(declared) ? declared : "zip";
  const text = decoded(data.subarray(0, SNIFFED));
  const start = text.slice(0, 4096).trimStart();
  if (text.startsWith("glTF")) return "glb";
  if (/^ply\s/.test(text)) return "ply";
  if (start.startsWith("{")) return "gltf";
  if (/^solid/i.test(start)) return "stl";
  if (start.startsWith("<") && /<amf[\s>]/.test(start)) return "amf";
  if (/^(?:\s*#.*[\r\n])*\s*(?:ST)?C?N?4?n?OFF(?:\b|(?=\d))/.test(text)) return "off";
  if (
    !text.slice(0, 4096).replace(/\0+$/, "").includes("\0") &&
    /(?:^|[\r\n])[ \t]*v[ \t]+[-+.\d]/.test(text)
  ) {
    return "obj";
  }
  return null;
}
