// OFF, as text or binary, with prefixes that keep three coordinates (COFF, NOFF, STOFF, ...), as
// `model.loading.off` reads it.

import { MeshError, type Mesh } from "../mesh";
import { readBytes, readText, type Element, type Field, type Found } from "./records";
import { textOf, Words } from "./text";
import { triangulate } from "./triangles";

const KEYWORD = /^((ST)?(C)?(N)?(4)?(n)?OFF)(?=\d|$)/;
const BINARY = /^(?:\s|#[^\r\n]*[\r\n])*((?:ST)?C?N?4?n?OFF)[ \t]*BINARY\b[^\n]*\n/;
const COUNT = /^\d{1,18}$/;
const CORNERS: Field = { name: "corners", item: "i4", count: "i4" };
const WANTED = { vertex: ["x", "y", "z"], face: ["corners"] };

export function readOff(data: Uint8Array): Mesh {
  const head = new TextDecoder("latin1").decode(data.subarray(0, 4096));
  const binary = BINARY.exec(head);
  const { tables, note } = binary
    ? readBinary(data, binary[0].length, extraOf(binary[1]))
    : readPlain(textOf(data));
  return { ...triangulate(tables.vertex.numbers, tables.face.items, tables.face.counts), note };
}

/** How many numbers are behind the coordinates of a vertex: texture 2, colour 4, normal 3. */
function extraOf(keyword: string): number {
  const [, , texture, colour, normal, fourth, free] = KEYWORD.exec(keyword)!;
  if (fourth || free) {
    throw new MeshError(
      "unsupported-feature",
      `${keyword} has vertices of other than three coordinates; export plain OFF`,
    );
  }
  return (texture ? 2 : 0) + (colour ? 4 : 0) + (normal ? 3 : 0);
}

/** Numbers are big-endian. */
function readBinary(data: Uint8Array, place: number, extra: number): Found {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const isWhole = place + 12 <= data.length && view.getInt32(place) >= 0 && view.getInt32(place + 4) >= 0;
  if (!isWhole) {
    throw new MeshError(
      "bad-header",
      "a binary OFF file begins with the counts of vertices, faces and edges",
    );
  }
  const colour: Field = { name: "colour", item: "f4", count: "i4" };
  const elements = [
    vertexOf(view.getInt32(place), extra),
    { name: "face", length: view.getInt32(place + 4), fields: [CORNERS, colour] },
  ];
  return readBytes(data, place + 12, false, elements, WANTED);
}

/** Lines of vertices and faces, or a stream. */
function readPlain(text: string): Found {
  const words = new Words(text, 0, true);
  let extra = 0;
  words.toNext();
  const start = words.place;
  const keyword = KEYWORD.exec(words.next());
  if (keyword) extra = extraOf(keyword[1]);
  words.place = start + (keyword ? keyword[1].length : 0);
  const counts = [words.next(), words.nextInLine()];
  // The count of edges is left out by some writers, who then end the line.
  if (!counts[1]) counts.splice(1, 1, words.next(), words.next());
  else counts.push(words.nextInLine() || "0");
  if (!counts.every((word) => COUNT.test(word))) {
    throw new MeshError(
      "bad-header",
      "an OFF file begins with the word OFF and the counts of vertices, faces and edges",
    );
  }
  // In a stream, a face cannot have a colour behind it.
  const face = { name: "face", length: Number(counts[1]), fields: [CORNERS] };
  return readText(text, words.place, [vertexOf(Number(counts[0]), extra), face], WANTED, true);
}

function vertexOf(length: number, extra: number): Element {
  const names = ["x", "y", "z", ...Array.from({ length: extra }, (_, i) => String(i))];
  return { name: "vertex", length, fields: names.map((name) => ({ name, item: "f4" })) };
}
