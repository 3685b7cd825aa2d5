// Stanford PLY, text and binary: vertices, and faces or triangle strips, as `model.loading.ply` reads
// them. three.js's loader leaves out polygons of more than four corners, and rounds to float32.

import { MeshError, type Mesh } from "../mesh";
import { limit } from "./limits";
import { readBytes, readText, type Element, type Kind, type Table, type Wanted } from "./records";
import { quoted, textOf } from "./text";
import { triangulate } from "./triangles";

const KINDS: Record<string, Kind | undefined> = {
  char: "i1",
  int8: "i1",
  uchar: "u1",
  uint8: "u1",
  short: "i2",
  int16: "i2",
  ushort: "u2",
  uint16: "u2",
  int: "i4",
  int32: "i4",
  uint: "u4",
  uint32: "u4",
  int64: "i8",
  uint64: "u8",
  float: "f4",
  float32: "f4",
  double: "f8",
  float64: "f8",
};
const ORDERS = ["ascii", "binary_little_endian", "binary_big_endian"];
const LONGEST_HEADER = 2 ** 18; // bytes
const FACES = ["face", "tristrips"];
const CORNER_NAMES = ["vertex_indices", "vertex_index"];

const badHeader = (message: string) => new MeshError("bad-header", message);

export function readPly(data: Uint8Array): Mesh {
  const bytes = data[0] === 0xef ? data.subarray(3) : data; // a byte-order mark
  const { lines, place } = splitHeader(bytes);
  const order = lines.find(([word, name]) => word === "format" && ORDERS.includes(name))?.[1];
  if (!order) throw badHeader(`the header names no format (one of ${ORDERS.join(", ")})`);
  const elements = elementsOf(lines);
  const wanted = wantedOf(elements);
  const { tables, note } =
    order === "ascii"
      ? readText(textOf(bytes.subarray(place)), 0, elements, wanted)
      : readBytes(bytes, place, order === "binary_little_endian", elements, wanted);
  const vertices = tables.vertex.numbers;
  const { items, counts } = tables.face ?? { items: [], counts: [] };
  const corners = tables.tristrips ? stripsOf(tables.tristrips) : [];
  const all = corners.length ? items.concat(corners) : items;
  const mesh = triangulate(vertices, all, counts.concat(new Array(corners.length / 3).fill(3)));
  return { ...mesh, note };
}

/** The corners of the triangles of strips, in which every second is wound the other way, and -1 begins
 * anew. */
function stripsOf({ items, counts }: Table): number[] {
  limit("faces", items.length);
  const corners: number[] = [];
  let start = 0;
  for (const count of counts) {
    let began = start;
    for (let i = start; i < start + count; i++) {
      if (items[i] < 0) began = i + 1;
      if (i - began < 2) continue;
      const [a, b] = (i - began) % 2 ? [i - 1, i - 2] : [i - 2, i - 1];
      corners.push(items[a], items[b], items[i]);
    }
    start += count;
  }
  return corners;
}

/** The words of each header line, and the byte at which the body begins. */
function splitHeader(data: Uint8Array): { lines: string[][]; place: number } {
  const head = new TextDecoder("latin1").decode(data.subarray(0, LONGEST_HEADER));
  const first = /^ply[ \t]*(\r\n|\n|\r)/.exec(head);
  const end = /[\r\n]end_header[ \t]*(\r\n|\n|\r|$)/.exec(head);
  if (!first || !end) {
    throw badHeader(
      "a PLY file begins with a header from 'ply' to 'end_header', of " +
        `${LONGEST_HEADER} bytes at most; it is cut off or damaged`,
    );
  }
  // Where lines end in CR, an LF behind the last is the first byte of the data.
  const place = end.index + end[0].length - Number(first[1] === "\r" && end[1] === "\r\n");
  const lines = head.slice(0, end.index).split(/[\r\n]/);
  return {
    lines: lines.map((line) => line.split(/\s+/).filter(Boolean)).filter((words) => words.length),
    place,
  };
}

/** The elements that the header declares, in the order of the body. */
function elementsOf(lines: string[][]): Element[] {
  const found: Element[] = [];
  for (const words of lines) {
    const [word, ...rest] = words;
    if (word !== "element" && word !== "property") continue;
    const last = found.at(-1);
    const [one, two, three, four] = rest;
    if (word === "element" && rest.length === 2 && /^\d{1,18}$/.test(two)) {
      found.push({ name: one, length: Number(two), fields: [] });
    } else if (
      last &&
      rest.length === 4 &&
      one === "list" &&
      KINDS[two]?.[0] !== "f" &&
      KINDS[two] &&
      KINDS[three]
    ) {
      last.fields.push({ name: four, item: KINDS[three], count: KINDS[two] });
    } else if (last && rest.length === 2 && KINDS[one]) {
      last.fields.push({ name: two, item: KINDS[one] });
    } else {
      throw badHeader(`the header line ${quoted(words.join(" "))} makes no sense`);
    }
  }
  return found;
}

/** The fields to read, by element. */
function wantedOf(elements: Element[]): Wanted {
  const named = (name: string) => elements.filter((element) => element.name === name);
  const [vertices, ...others] = named("vertex");
  if (!vertices || others.length || FACES.some((name) => named(name).length > 1)) {
    throw badHeader("the header must declare vertices once, and faces once");
  }
  const numbers = vertices.fields.filter(({ count }) => !count).map(({ name }) => name);
  const missing = ["x", "y", "z"].filter((axis) => numbers.filter((name) => name === axis).length !== 1);
  if (missing.length) throw badHeader(`the vertex element has no one property ${missing.join(", ")}`);
  const faces = FACES.flatMap(named).map((element) => [element.name, [cornersOf(element)]]);
  return { vertex: ["x", "y", "z"], ...Object.fromEntries(faces) };
}

/** The list of vertex indices, by either of its names or as the only list there is. */
function cornersOf({ name, fields }: Element): string {
  const lists = fields.filter(({ item, count }) => count && item[0] !== "f").map((field) => field.name);
  const known = lists.filter((list) => CORNER_NAMES.includes(list));
  const [corners, ...others] = known.length ? known : lists;
  if (corners && !others.length) return corners;
  throw badHeader(
    `the ${name} element has no one list property ${CORNER_NAMES.join(" or ")} of whole numbers`,
  );
}
