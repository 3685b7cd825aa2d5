// glTF 2.0 through three.js's loader, without materials and images, which would have to be fetched; at
// rest, as `model.loading.gltf` reads it.

import { InstancedMesh, Matrix4, Mesh as Object3DMesh, SkinnedMesh, Vector3, type Object3D } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { MeshError, type Mesh } from "../mesh";
import { limit } from "./limits";
import { flatten, type Placed } from "./scene";
import { decoded, quoted } from "./text";

const MAGIC = 0x46546c67;
const JSON_CHUNK = 0x4e4f534a;
const BINARY_CHUNK = 0x004e4942;
// Extensions that a file may require: the loader has them, or they leave vertices where they are.
const READ =
  /^(KHR_mesh_quantization|EXT_mesh_gpu_instancing|KHR_node_.*ability|(KHR|ADOBE|NV)_materials_.*|(KHR|EXT|MSFT)_texture_.*|(KHR|EXT)_lights_.*|KHR_animation_pointer|KHR_xmp.*|MSFT_packing.*|VRM.*)$/;

interface Node {
  mesh?: number;
  children?: number[];
  extensions?: { KHR_node_visibility?: { visible?: boolean } };
}

interface Primitive {
  attributes: Record<string, number>;
  targets?: Record<string, number>[];
  material?: number;
  extensions?: object;
}

interface View {
  buffer: number;
  byteOffset?: number;
  byteLength: number;
  extensions?: object;
}

interface Document {
  asset?: { version?: string };
  scene?: number;
  scenes?: { nodes?: number[] }[];
  nodes?: Node[];
  meshes?: { primitives: Primitive[] }[];
  skins?: object[];
  accessors?: { count?: number }[];
  bufferViews?: View[];
  buffers?: { uri?: string; byteLength: number }[];
  extensionsRequired?: string[];
}

/** Files beside a .gltf, by their paths relative to it. */
export type Pieces = Map<string, Uint8Array>;

/** A mesh, with the colours of its vertices, 3 each in linear light, if all its parts have them. */
export interface ColouredMesh extends Mesh {
  colours?: Float32Array;
}

const unsupported = (what: string) =>
  new MeshError(
    "unsupported-feature",
    `${what} in the browser; the service reads more, or export as plain glTF 2.0 without it`,
  );

const truncated = (needed: number, found: number) =>
  new MeshError(
    "truncated",
    `${needed} bytes are declared where the file has ${found}; it is cut off, export or upload it again`,
  );

export async function readGltf(data: Uint8Array, pieces: Pieces = new Map()): Promise<ColouredMesh> {
  const { text, binary } = split(data);
  const document = parse(text);
  showRoots(document);
  const buffer = joinBuffers(document, binary, pieces);
  const { scene } = await new GLTFLoader().parseAsync(container(bare(document), buffer), "");
  return meshOf(scene);
}

/** The JSON of a .glb, and its binary part; or all, which is JSON. */
function split(data: Uint8Array): { text: Uint8Array; binary: Uint8Array | null } {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  if (data.length < 4 || view.getUint32(0, true) !== MAGIC) return { text: data, binary: null };
  if (data.length < 20) throw truncated(20, data.length);
  const version = view.getUint32(4, true);
  if (version !== 2) throw unsupported(`binary glTF version ${version} is not read`);
  const chunk = (place: number) => {
    const [length, kind] = [view.getUint32(place, true), view.getUint32(place + 4, true)];
    const end = place + 8 + length;
    if (end > data.length) throw truncated(end, data.length);
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

function parse(bytes: Uint8Array): Document {
  const text = decoded(bytes).replace(/\0+$/, "");
  let values = 0;
  // Every value follows one of these; the base64 of a buffer has none.
  for (let i = 0; i < text.length; i++) if (",[{".includes(text[i])) values++;
  limit("values", values);
  let document: Document;
  try {
    document = JSON.parse(text);
  } catch (error) {
    throw new MeshError("bad-document", `the file's JSON is damaged or cut off: ${(error as Error).message}`);
  }
  const version = String(document.asset?.version ?? "2.0");
  if (!/^2(\.|$)/.test(version) || !Array.isArray(document.meshes ?? [])) {
    throw unsupported(`glTF version ${quoted(version)} is not read`);
  }
  const unread = (document.extensionsRequired ?? []).filter((name) => !READ.test(name));
  if (unread.length) throw unsupported(`the file requires ${quoted(unread.join(", "))}, which is not read`);
  limit("geometries", document.nodes?.length ?? 0);
  // Of what the loader makes arrays; at most three corners a face, and the vertices.
  const rows = (document.accessors ?? []).reduce((sum, { count }) => sum + (count ?? 0), 0);
  limit("faces", rows / 4, `the file has arrays of ${rows} rows`);
  return document;
}

/** Check that nodes form trees, let the scene list roots that are visible, and take meshes that no node
 * shows as they are. The loader would wait for a node that is its own ancestor. */
function showRoots(document: Document): void {
  if (!document.nodes?.length) {
    document.nodes = (document.meshes ?? []).map((_, mesh) => ({ mesh }));
    document.scenes = [];
  }
  const { nodes } = document;
  const parents = new Map<number, number>();
  for (const [number, { children = [] }] of nodes.entries()) {
    for (const child of new Set(children)) {
      if (parents.has(child)) throw badScene("a node has two parents");
      parents.set(child, number);
    }
  }
  const all = [...nodes.keys()];
  const order = all.filter((number) => !parents.has(number));
  const roots = [...order];
  // The list grows as it is gone through.
  for (const number of order) order.push(...new Set(nodes[number].children ?? []));
  if (order.length < nodes.length) throw badScene("a node is its own ancestor");
  const hidden = new Set<number>();
  for (const number of order) {
    const isHidden = nodes[number].extensions?.KHR_node_visibility?.visible === false;
    if (isHidden || hidden.has(parents.get(number)!)) {
      hidden.add(number);
      delete nodes[number].mesh;
    }
  }
  const listed = new Set(document.scenes?.length ? document.scenes[document.scene ?? 0].nodes : roots);
  // Some list a child beside its parent, under which it is drawn.
  const isUnder = (number: number | undefined): boolean =>
    number !== undefined && (listed.has(number) || isUnder(parents.get(number)));
  document.scenes = [{ nodes: [...listed].filter((number) => !isUnder(parents.get(number))) }];
  document.scene = 0;
}

const badScene = (what: string) => new MeshError("bad-scene", `${what}; nodes must form trees`);

/** One buffer of all, to which the views then refer. */
function joinBuffers(document: Document, binary: Uint8Array | null, pieces: Pieces): Uint8Array {
  const contents = (document.buffers ?? []).map(({ uri, byteLength }, i) => {
    const content = uri === undefined ? (i === 0 ? binary : null) : contentOf(uri, pieces);
    if (!content) throw new MeshError("missing-data", `buffer ${i} has no data in the file`);
    if (byteLength > content.length) throw truncated(byteLength, content.length);
    return content;
  });
  const starts = [0];
  for (const { length } of contents) starts.push(starts.at(-1)! + 8 * Math.ceil(length / 8));
  const joined = new Uint8Array(starts.at(-1)!);
  contents.forEach((content, i) => joined.set(content, starts[i]));
  for (const view of document.bufferViews ?? []) {
    const [begin, size] = [view.byteOffset ?? 0, contents[view.buffer]?.length ?? 0];
    if (begin + view.byteLength > size) throw truncated(begin + view.byteLength, size);
    view.byteOffset = starts[view.buffer] + begin;
    view.buffer = 0;
  }
  return joined;
}

/** The bytes in an address, or of the file that a path names; no address is ever opened. */
function contentOf(uri: string, pieces: Pieces): Uint8Array {
  const embedded = /^data:[^,]*?(;base64)?,/.exec(uri);
  if (embedded) {
    const content = decodeURIComponent(uri.slice(embedded[0].length));
    return Uint8Array.from(embedded[1] ? atob(content) : content, (character) => character.charCodeAt(0));
  }
  const piece = pieces.get(decodeURIComponent(uri).replace(/^\.\//, ""));
  if (piece) return piece;
  throw new MeshError(
    "missing-data",
    `the file keeps its data in ${quoted(uri)}, which is not there; give both, or export as .glb`,
  );
}

/** What the loader needs for the shape and the colours of vertices. */
function bare({ scene, scenes, nodes, meshes, skins, accessors, bufferViews }: Document) {
  for (const { primitives } of meshes ?? []) {
    for (const primitive of primitives) {
      delete primitive.material;
      delete primitive.extensions; // what is packed there is here unpacked, too
      const isUsed = ([name]: [string, number]) => /^(POSITION|COLOR_0|JOINTS_\d|WEIGHTS_\d)$/.test(name);
      primitive.attributes = Object.fromEntries(Object.entries(primitive.attributes).filter(isUsed));
      primitive.targets = primitive.targets?.map(({ POSITION }) => ({ POSITION }));
    }
  }
  for (const view of bufferViews ?? []) delete view.extensions;
  const asset = { version: "2.0" };
  return { asset, scene, scenes, nodes, meshes, skins, accessors, bufferViews };
}

/** A .glb of a document and one buffer. */
function container(document: object, buffer: Uint8Array): ArrayBuffer {
  const buffers = [{ byteLength: buffer.length }];
  const json = new TextEncoder().encode(JSON.stringify({ ...document, buffers }));
  const padded = new Uint8Array(4 * Math.ceil(json.length / 4)).fill(32);
  padded.set(json);
  const result = new Uint8Array(28 + padded.length + buffer.length);
  const words = [MAGIC, 2, result.length, padded.length, JSON_CHUNK];
  const view = new DataView(result.buffer);
  words.forEach((word, i) => view.setUint32(4 * i, word, true));
  result.set(padded, 20);
  view.setUint32(20 + padded.length, buffer.length, true);
  view.setUint32(24 + padded.length, BINARY_CHUNK, true);
  result.set(buffer, 28 + padded.length);
  return result.buffer;
}

/** All triangles below an object, where it places them. */
function meshOf(root: Object3D): ColouredMesh {
  const placed: Placed[] = [];
  const colours: (Float32Array | null)[] = [];
  root.updateMatrixWorld(true);
  root.traverse((object) => {
    if (!(object instanceof Object3DMesh) || !object.geometry.hasAttribute("position")) return;
    const part = partOf(object);
    const count = object instanceof InstancedMesh ? object.count : 1;
    for (let i = 0; i < count; i++) {
      const matrix = new Matrix4();
      if (object instanceof InstancedMesh) object.getMatrixAt(i, matrix);
      placed.push({ part, matrix: matrix.premultiply(object.matrixWorld) });
      colours.push(coloursOf(object));
    }
  });
  const mesh = flatten(placed);
  if (!colours.length || colours.includes(null)) return mesh;
  const joined = new Float32Array(mesh.vertices.length);
  let place = 0;
  for (const some of colours as Float32Array[]) {
    joined.set(some, place);
    place += some.length;
  }
  return { ...mesh, colours: joined };
}

/** The triangles of an object, moved by its morph targets and joints. */
function partOf(object: Object3DMesh): Mesh {
  const { geometry } = object;
  if (object instanceof SkinnedMesh) for (const bone of object.skeleton.bones) bone.updateWorldMatrix(true, false);
  const vertices = new Float64Array(3 * geometry.getAttribute("position").count);
  const point = new Vector3();
  for (let v = 0; v < vertices.length / 3; v++) object.getVertexPosition(v, point).toArray(vertices, 3 * v);
  const corners = 3 * Math.floor((geometry.index?.count ?? vertices.length / 3) / 3);
  const faces = Int32Array.from({ length: corners }, (_, h) => geometry.index?.getX(h) ?? h);
  return { vertices, faces };
}

function coloursOf({ geometry }: Object3DMesh): Float32Array | null {
  if (!geometry.hasAttribute("color")) return null;
  const colour = geometry.getAttribute("color");
  const result = new Float32Array(3 * colour.count);
  for (let v = 0; v < colour.count; v++) result.set([colour.getX(v), colour.getY(v), colour.getZ(v)], 3 * v);
  return result;
}
