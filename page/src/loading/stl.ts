// STL, binary and text, as `model.loading.stl` reads it.

import { MeshError, type Mesh } from "../mesh";
import { limit } from "./limits";
import { textOf, Words } from "./text";

const HEADER = 84; // bytes: 80 of any content, then the count of triangles
const RECORD = 50; // bytes: a normal, three corners, two bytes of attributes

const declaredCount = (data: Uint8Array) => new DataView(data.buffer, data.byteOffset).getUint32(80, true);

const declaredLength = (data: Uint8Array) => HEADER + RECORD * declaredCount(data);

/** Whether the count in the header fits the length to the byte, as only binary STL does. */
export const isExactBinary = (data: Uint8Array) =>
  data.length >= HEADER && declaredLength(data) === data.length;

/** The triangles of an STL file, three vertices of their own each. */
export function readStl(data: Uint8Array): Mesh {
  // "solid" at the start says nothing, many binary files have it. The count does: as text, its four
  // bytes would declare a file of more than seven gigabytes.
  if (data.length >= HEADER && declaredLength(data) <= data.length) return readBinary(data);
  const start = new TextDecoder("latin1").decode(data.subarray(0, 1024));
  if (/solid/i.test(start) && !start.replace(/\0+$/, "").includes("\0")) return readText(textOf(data));
  const found =
    data.length < HEADER
      ? `the file has ${data.length} bytes, but a binary STL has at least ${HEADER}`
      : `the header declares ${declaredCount(data)} triangles, which is ` +
        `${declaredLength(data)} bytes, but the file has ${data.length}`;
  throw new MeshError("truncated", `${found}; it is cut off, export or upload it again`);
}

function readBinary(data: Uint8Array): Mesh {
  const declared = declaredCount(data);
  const whole = Math.floor((data.length - HEADER) / RECORD);
  const rest = (data.length - HEADER) % RECORD;
  let count = declared;
  let note = "";
  if (whole > declared && data.subarray(declaredLength(data)).some(Boolean)) {
    // Writers that do not know the count beforehand leave 0, or what they expected.
    if (!rest || !declared) {
      count = whole;
      note = `The STL header declares ${declared} triangles, but ${count} follow: all were read.`;
    } else {
      note =
        `The STL file goes on for ${data.length - declaredLength(data)} bytes after the ` +
        `${declared} triangles that its header declares; they were not read.`;
    }
  }
  limit("faces", count);
  limit("vertices", 3 * count);
  const view = new DataView(data.buffer, data.byteOffset);
  const vertices = new Float64Array(9 * count);
  for (let i = 0; i < vertices.length; i++) {
    vertices[i] = view.getFloat32(HEADER + RECORD * Math.floor(i / 9) + 12 + 4 * (i % 9), true);
  }
  return { vertices, faces: inTurn(3 * count), note };
}

/** White space is free, and the name of a solid is any words: outside of a facet, only the two words
 * that begin one and the end of the solid count. */
function readText(text: string): Mesh {
  const words = new Words(text);
  const vertices: number[] = [];
  let facets = 0;
  let [inside, solid] = [false, true];
  let word = words.next().toLowerCase();
  while (word) {
    let next = words.next();
    if (word === "end" && /^(facet|solid)$/i.test(next)) {
      word += next.toLowerCase();
      next = words.next();
    }
    const opens = word === "facet" && /^(normal|outer|vertex)$/i.test(next);
    const ends = word === "endsolid";
    if (opens || ends || word === "endfacet") {
      if (vertices.length !== 9 * facets) throw badFacet(words);
      [inside, solid] = [opens, !ends];
      facets += Number(opens);
    } else if (inside && word === "vertex") {
      if (vertices.length === 9 * facets) throw badFacet(words);
      for (let axis = 0; axis < 3; axis++) {
        if (!next) throw cutOff();
        vertices.push(words.number(next));
        next = words.next();
      }
    }
    word = next.toLowerCase();
  }
  if (solid || inside) throw cutOff();
  limit("faces", facets);
  limit("vertices", 3 * facets);
  return { vertices: Float64Array.from(vertices), faces: inTurn(3 * facets) };
}

const inTurn = (count: number) => Int32Array.from({ length: count }, (_, i) => i);

const cutOff = () =>
  new MeshError("truncated", "the text ends without 'endsolid'; it is cut off, export it again");

const badFacet = (words: Words) =>
  new MeshError(
    "bad-face",
    "each facet must have three vertices, unlike the one that ends in the line " +
      `${words.line}; the file is damaged or was written wrongly`,
  );
