// The JSON of a glTF 2.0 file, and its entries, whose types are checked where they are used, as
// `model.loading.gltf.document` checks them.

import { MeshError } from "../../mesh";
import { limit } from "../limits";
import { decoded, quoted } from "../text";

export type Entry = Record<string, unknown>;

const MAGIC = 0x46546c67;
const JSON_CHUNK = 0x4e4f534a;
const BINARY_CHUNK = 0x004e4942;
// Extensions that a file may require: they are read, or leave the vertices where they are.
const READ = new RegExp(
  "^(KHR_mesh_quantization|EXT_mesh_gpu_instancing|KHR_node_.*ability|KHR_animation_pointer" +
    "|(KHR|ADOBE|NV)_materials_.*|(KHR|EXT|MSFT|MPEG)_texture_.*|(KHR|EXT)_lights_.*|KHR_interactivity" +
    "|(KHR|OMI)_(audio|physics).*|(KHR_xmp|MSFT_packing|VRM|AGI_|FB_).*|MSFT_lod|CESIUM_RTC" +
    "|CESIUM_primitive_outline|EXT_mesh_(features|manifold)|EXT_(structural|feature)_metadata" +
    "|EXT_instance_features)$",
);

/** The error for a feature that is not read here. */
export const unsupported = (what: string) =>
  new MeshError(
    "unsupported-feature",
    `${what} in the browser; use meshconv3d classify, which reads more, or export as plain glTF 2.0 without it`,
  );

/** The error for data that ends too early. */
export const cutOff = (needed: number, found: number) =>
  new MeshError(
    "truncated",
    `${needed} bytes are declared where the file has ${found}; it is cut off, export or upload it again`,
  );

/** The JSON of a .glb and its binary part, or all, which is JSON. */
export function split(data: Uint8Array): { text: Uint8Array; binary: Uint8Array | null } {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  if (data.length < 4 || view.getUint32(0, true) !== MAGIC) return { text: data, binary: null };
  if (data.length < 20) throw cutOff(20, data.length);
  const version = view.getUint32(4, true);
  if (version !== 2) throw unsupported(`binary glTF version ${version} is not read`);
  const chunk = (place: number) => {
    const [length, kind] = [view.getUint32(place, true), view.getUint32(place + 4, true)];
    const end = place + 8 + length;
    if (end > data.length) throw cutOff(end, data.length);
    return { kind, content: data.subarray(place + 8, end), end };
  };
  const first = chunk(12);
  if (first.kind !== JSON_CHUNK) {
    throw new MeshError("bad-header", "the first chunk of a .glb must be its JSON document");
  }
  // The binary part, if there is one, is the second chunk; others are passed over.
  const second = first.end + 8 <= data.length ? chunk(first.end) : null;
  return { text: first.content, binary: second?.kind === BINARY_CHUNK ? second.content : null };
}

export function parse(bytes: Uint8Array): Entry {
  const text = decoded(bytes).replace(/\0+$/, "");
  let values = 0;
  // Every value follows one of these; the base64 of a buffer has none.
  for (let i = 0; i < text.length; i++) if (",[{".includes(text[i])) values++;
  limit("values", values);
  let parsed: unknown;
  try {
    parsed = JSON.parse(text);
  } catch (error) {
    throw new MeshError("bad-document", `the file's JSON is damaged or cut off: ${(error as Error).message}`);
  }
  const document = entry(parsed, "a glTF document");
  const version = String(child(document, "asset").version ?? "2.0");
  const isFirst = document.meshes !== undefined && !Array.isArray(document.meshes);
  if (isFirst || version.split(".")[0] !== "2")
    throw unsupported(`glTF version ${quoted(version)} is not read`);
  const unread = list(document, "extensionsRequired")
    .map(String)
    .filter((name) => !READ.test(name));
  if (unread.length) throw unsupported(`the file requires ${quoted(unread.join(", "))}, which is not read`);
  return document;
}

/** The list under `key`, empty where there is none. */
export function list(owner: Entry, key: string): unknown[] {
  const found = owner[key] ?? [];
  if (!Array.isArray(found)) throw wrong(key, "a list");
  return found;
}

/** The object under `key`, empty where there is none. */
export const child = (owner: Entry, key: string) => entry(owner[key] ?? {}, key);

/** What an extension says of an entry, or null. */
export function extension(owner: Entry, name: string): Entry | null {
  const found = child(owner, "extensions")[name];
  return found === undefined ? null : entry(found, name);
}

/** All entries of a list of objects. */
export const items = (owner: Entry, key: string) =>
  list(owner, key).map((found) => entry(found, `an entry of ${key}`));

/** The entry `number` of a list of the document. */
export function item(document: Entry, kind: string, number: unknown): Entry {
  const found = list(document, kind);
  return entry(found[index(number, found.length, kind)], `an entry of ${kind}`);
}

/** `number`, an index into `length` entries. */
export function index(number: unknown, length: number, kind: string): number {
  if (natural(number, `an index into ${kind}`) < length) return number as number;
  throw new MeshError("bad-reference", `entry ${number} of ${kind} is used, but there are ${length}`);
}

export function natural(value: unknown, what: string): number {
  if (Number.isSafeInteger(value) && (value as number) >= 0) return value as number;
  throw new MeshError("bad-number", `${what} must be a whole number from 0`);
}

/** The finite numbers under `key`, `count` of them or any. */
export function reals(owner: Entry, key: string, count?: number): number[] {
  const found = list(owner, key);
  if (found.length === (count ?? found.length) && found.every(Number.isFinite)) return found as number[];
  throw new MeshError("bad-number", `${key} must be ${count === undefined ? "" : `${count} `}finite numbers`);
}

function entry(value: unknown, what: string): Entry {
  if (typeof value !== "object" || value === null || Array.isArray(value)) throw wrong(what, "an object");
  return value as Entry;
}

const wrong = (what: string, expected: string) =>
  new MeshError("bad-document", `${what} must be ${expected} in glTF`);
