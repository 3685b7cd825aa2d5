// The arrays of a glTF file, as `model.loading.gltf.arrays` reads them: what it says of its bytes is
// checked before any are read.

import { MeshError } from "../../mesh";
import { limit } from "../limits";
import { quoted } from "../text";
import { child, cutOff, extension, item, natural, unsupported, type Entry } from "./document";

/** Files beside a .gltf, by their paths relative to it. */
export type Pieces = Map<string, Uint8Array>;

interface Component {
  size: number;
  /** The greatest integer, which is 1 where numbers are normalised. */
  most?: number;
  get(view: DataView, place: number): number;
}

const COMPONENTS: Record<number, Component | undefined> = {
  5120: { size: 1, most: 127, get: (view, place) => view.getInt8(place) },
  5121: { size: 1, most: 255, get: (view, place) => view.getUint8(place) },
  5122: { size: 2, most: 32767, get: (view, place) => view.getInt16(place, true) },
  5123: { size: 2, most: 65535, get: (view, place) => view.getUint16(place, true) },
  5125: { size: 4, most: 4294967295, get: (view, place) => view.getUint32(place, true) },
  5126: { size: 4, get: (view, place) => view.getFloat32(place, true) },
};
const WIDTHS = { SCALAR: 1, VEC3: 3, VEC4: 4, MAT4: 16 };

export const [INTEGERS, POSITIONS] = [
  [5121, 5123, 5125],
  [5120, 5121, 5122, 5123, 5126],
];
export const FLOATS = [5126];

const badAccessor = (message: string) => new MeshError("bad-accessor", message);

/** The bytes of a document's buffers. binary: the content of buffer 0 where that has no URI. */
export class Buffers {
  private readonly contents = new Map<unknown, Uint8Array>();
  private rows = 0;

  constructor(
    readonly document: Entry,
    private readonly binary: Uint8Array | null,
    private readonly pieces: Pieces,
  ) {}

  /** The numbers of an accessor, row by row. shape: as in the document, "VEC3"; kinds: the numbers of
   * component types that are read. */
  read(number: unknown, shape: keyof typeof WIDTHS, kinds: number[]): Float64Array {
    const entry = item(this.document, "accessors", number);
    const kind = natural(entry.componentType, "componentType");
    const component = COMPONENTS[kind];
    if (entry.type !== shape || !component || !kinds.includes(kind)) {
      throw badAccessor(
        `an accessor of ${quoted(String(entry.type))}, componentType ${kind}, is used where ${shape} is expected`,
      );
    }
    const count = natural(entry.count, "count");
    // Each is counted as often as it is read.
    this.rows += count;
    limit("vertices", Math.ceil(this.rows / 4), `the file has arrays of ${this.rows} rows`);
    if (extension(entry, "WEB3D_quantized_attributes"))
      throw unsupported("quantized attributes are not read");
    if (entry.bufferView === undefined && entry.sparse === undefined) {
      throw unsupported("positions or indices have no data of their own, by an extension, and are not read");
    }
    const width = WIDTHS[shape];
    const values =
      entry.bufferView === undefined
        ? new Float64Array(count * width)
        : this.table(entry, component, width, count, true);
    if (entry.sparse !== undefined) this.replace(values, child(entry, "sparse"), component, width);
    const { most } = component;
    return entry.normalized && most ? values.map((value) => Math.max(value / most, -1)) : values;
  }

  /** Numbers in the view that an accessor, or a part of a sparse one, names. */
  private table(
    entry: Entry,
    component: Component,
    width: number,
    count: number,
    strided = false,
  ): Float64Array {
    const { content, byteStride } = this.view(entry.bufferView);
    const start = natural(entry.byteOffset ?? 0, "byteOffset");
    const size = width * component.size;
    const stride = strided && byteStride !== undefined ? natural(byteStride, "byteStride") : size;
    if (count > 1 && stride < size) throw badAccessor(`a byteStride of ${stride} is less than ${size} bytes`);
    const end = count ? start + (count - 1) * stride + size : start;
    if (end > content.length) throw cutOff(end, content.length);
    const view = new DataView(content.buffer, content.byteOffset, content.length);
    const values = new Float64Array(count * width);
    for (let row = 0, i = 0; row < count; row++) {
      for (let k = 0; k < width; k++)
        values[i++] = component.get(view, start + row * stride + k * component.size);
    }
    return values;
  }

  /** Put in the rows that a sparse accessor replaces. */
  private replace(values: Float64Array, sparse: Entry, component: Component, width: number): void {
    const count = natural(sparse.count, "count");
    if (count * width > values.length) {
      throw badAccessor(`a sparse accessor of ${values.length / width} rows replaces ${count}`);
    }
    const [at, other] = [child(sparse, "indices"), child(sparse, "values")];
    const kind = natural(at.componentType, "componentType");
    if (!INTEGERS.includes(kind) || at.bufferView === undefined || other.bufferView === undefined) {
      throw badAccessor("a sparse accessor has no rows or no values");
    }
    const rows = this.table(at, COMPONENTS[kind]!, 1, count);
    const others = this.table(other, component, width, count);
    rows.forEach((row, i) => {
      if (row * width >= values.length) throw badAccessor("a sparse accessor names a row past its end");
      values.set(others.subarray(i * width, (i + 1) * width), row * width);
    });
  }

  private view(number: unknown): { content: Uint8Array; byteStride: unknown } {
    const view = item(this.document, "bufferViews", number);
    for (const name of ["EXT_meshopt_compression", "KHR_meshopt_compression"]) {
      if (extension(view, name)) throw unsupported("what meshopt packs is not read");
    }
    const content = this.content(view.buffer);
    const begin = natural(view.byteOffset ?? 0, "byteOffset");
    const end = begin + natural(view.byteLength ?? Math.max(content.length - begin, 0), "byteLength");
    if (end > content.length) throw cutOff(end, content.length);
    return { content: content.subarray(begin, end), byteStride: view.byteStride };
  }

  private content(number: unknown): Uint8Array {
    const buffer = item(this.document, "buffers", number);
    const known = this.contents.get(number);
    if (known) return known;
    const content = buffer.uri === undefined ? (number === 0 ? this.binary : null) : this.named(buffer.uri);
    if (!content) throw new MeshError("missing-data", "a buffer has neither data in the file nor a URI");
    const declared = natural(buffer.byteLength ?? 0, "byteLength");
    if (content.length < declared) throw cutOff(declared, content.length);
    this.contents.set(number, content);
    return content;
  }

  /** The bytes in an address, or of the file that a path names; no address is ever opened. */
  private named(uri: unknown): Uint8Array {
    const text = String(uri);
    if (text.startsWith("data:")) return embedded(text);
    const piece = this.pieces.get(unescaped(text).replace(/^\.\//, ""));
    if (piece) return piece;
    throw new MeshError(
      "external-reference",
      `the geometry lies in another file, ${quoted(text)}, which is not there: give the two ` +
        "together, or export as .glb, which holds everything in one file",
    );
  }
}

function embedded(uri: string): Uint8Array {
  const comma = uri.indexOf(",");
  const payload = unescaped(uri.slice(comma + 1));
  try {
    const bytes = uri.slice(0, comma).endsWith(";base64") ? atob(payload) : payload;
    return Uint8Array.from(bytes, (character) => character.charCodeAt(0));
  } catch {
    throw new MeshError("bad-data-uri", "a buffer's data: URI is no base64; export the file again");
  }
}

/** Text in which %xx stands for a byte. */
const unescaped = (text: string) =>
  text.replace(/%([0-9a-f]{2})/gi, (_, code: string) => String.fromCharCode(parseInt(code, 16)));
