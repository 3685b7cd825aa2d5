// glTF 2.0, binary and JSON, as `model.loading.gltf` reads it: the surfaces that the scene shows, at
// rest. three.js's loader waits for ever, or half a minute, for some damaged files, and would open
// addresses that one names.

import { Matrix4, Quaternion, Vector3 } from "three";
import { MeshError, type Mesh } from "../../mesh";
import { limit } from "../limits";
import { flatten, type Placed } from "../scene";
import { Buffers, FLOATS, INTEGERS, POSITIONS, type Pieces } from "./arrays";
import {
  child,
  extension,
  index,
  item,
  items,
  list,
  natural,
  parse,
  reals,
  split,
  unsupported,
  type Entry,
} from "./document";

export type { Pieces };

const [TRIANGLES, STRIP, FAN] = [4, 5, 6];
const SETS = 4; // of joints and weights, four of each in a set

/** A mesh, with the colours of its vertices if they were asked for, 3 each in linear light. */
export interface ColouredMesh extends Mesh {
  colours?: Float32Array;
}

/** coloured: whether to read the colours, which then all primitives must have. */
export function readGltf(data: Uint8Array, pieces: Pieces = new Map(), coloured = false): ColouredMesh {
  const { text, binary } = split(data);
  const document = parse(text);
  const surfaces = new Surfaces(document, new Buffers(document, binary, pieces), coloured);
  const placed = surfaces.placed();
  const mesh = flatten(placed);
  if (!coloured) return mesh;
  return { ...mesh, colours: Float32Array.from(placed.flatMap(({ part }) => [...(part.colours ?? [])])) };
}

/** The surfaces of a mesh. count: of its primitives and morph targets. */
interface Known {
  parts: ColouredMesh[];
  count: number;
}

class Surfaces {
  private readonly nodes: Entry[];
  private readonly matrices: Matrix4[];
  private readonly known = new Map<string, Known>();
  private faces = 0;

  constructor(
    private readonly document: Entry,
    private readonly buffers: Buffers,
    private readonly coloured: boolean,
  ) {
    const [nodes, meshes] = [items(document, "nodes"), items(document, "meshes")];
    limit("geometries", nodes.length);
    // A library of meshes that nothing places: take each as it is.
    this.nodes = nodes.length ? nodes : meshes.map((_, mesh) => ({ mesh }));
    if (!nodes.length) this.document = { ...document, scenes: [] };
    this.matrices = new Array<Matrix4>(this.nodes.length);
  }

  /** Each surface that the scene shows, and where. */
  placed(): (Placed & { part: ColouredMesh })[] {
    const { parents, order } = this.tree();
    for (const number of order) {
      const [parent, local] = [parents[number], localMatrix(this.nodes[number])];
      this.matrices[number] = parent < 0 ? local : local.premultiply(this.matrices[parent]);
    }
    const placed: (Placed & { part: ColouredMesh })[] = [];
    let geometries = 0;
    for (const number of this.shown(parents, order)) {
      const node = this.nodes[number];
      if (node.mesh === undefined) continue;
      const { parts, count } = this.parts(node);
      geometries += count;
      limit("geometries", geometries);
      const transforms = node.skin === undefined ? this.instances(node) : [new Matrix4()];
      limit("geometries", placed.length + parts.length * transforms.length);
      for (const transform of transforms) {
        const matrix = node.skin === undefined ? transform.premultiply(this.matrices[number]) : transform;
        for (const part of parts) placed.push({ part, matrix });
      }
    }
    return placed;
  }

  /** The parent of each node, -1 for none, and all nodes, each after its parent. */
  private tree() {
    const { nodes } = this;
    const parents = new Int32Array(nodes.length).fill(-1);
    const below = nodes.map(
      (node) => new Set(list(node, "children").map((number) => index(number, nodes.length, "nodes"))),
    );
    for (const [number, children] of below.entries()) {
      for (const inner of children) {
        if (parents[inner] >= 0) throw badScene("a node has two parents");
        parents[inner] = number;
      }
    }
    const order = [...nodes.keys()].filter((number) => parents[number] < 0);
    for (const number of order) order.push(...below[number]); // which grows as it is gone through
    if (order.length < nodes.length) throw badScene("a node is its own ancestor");
    return { parents, order };
  }

  /** The nodes of the scene that are visible, each once: some scenes list a child beside its parent. */
  private shown(parents: Int32Array, order: number[]): number[] {
    const { document, nodes } = this;
    let listed = new Set(order.filter((number) => parents[number] < 0));
    if (list(document, "scenes").length) {
      const scene = item(document, "scenes", document.scene ?? 0);
      listed = new Set(list(scene, "nodes").map((number) => index(number, nodes.length, "nodes")));
    }
    const [shown, hidden] = [new Set<number>(), new Set<number>()];
    for (const number of order) {
      if (listed.has(number) || shown.has(parents[number])) shown.add(number);
      const isHidden = extension(nodes[number], "KHR_node_visibility")?.visible === false;
      if (isHidden || hidden.has(parents[number])) hidden.add(number);
    }
    return order.filter((number) => shown.has(number) && !hidden.has(number));
  }

  /** The surfaces of a node's mesh: one for the primitives that share their positions, and what moves
   * these. Points and lines are passed over. */
  private parts(node: Entry): Known {
    const mesh = item(this.document, "meshes", node.mesh);
    const weights = reals(node.weights === undefined ? mesh : node, "weights");
    const known = [node.mesh, node.skin, ...weights].join();
    const found = this.known.get(known);
    if (found) return found;
    const joints = node.skin === undefined ? null : this.joints(item(this.document, "skins", node.skin));
    const surfaces = new Map<
      string,
      { vertices: Float64Array; corners: number[][]; colours?: Float32Array }
    >();
    const primitives = items(mesh, "primitives");
    const count = primitives.length + weights.filter(Boolean).length;
    limit("geometries", count);
    for (const primitive of primitives) {
      const mode = natural(primitive.mode ?? TRIANGLES, "mode");
      const attributes = child(primitive, "attributes");
      if (![TRIANGLES, STRIP, FAN].includes(mode) || attributes.POSITION === undefined) continue;
      const targets = items(primitive, "targets")
        .map(({ POSITION }, i) => ({ offsets: POSITION, weight: weights[i] }))
        .filter(({ offsets, weight }) => weight && offsets !== undefined);
      const sets = joints ? skinSets(attributes) : [];
      const key = JSON.stringify([attributes.POSITION, targets, sets, attributes.COLOR_0]);
      let surface = surfaces.get(key);
      if (!surface) {
        const vertices = this.vertices(attributes.POSITION, targets);
        surface = { vertices: joints ? this.moved(vertices, joints, sets) : vertices, corners: [] };
        if (this.coloured) surface.colours = this.colours(attributes.COLOR_0);
        surfaces.set(key, surface);
      }
      surface.corners.push(this.corners(primitive, mode, surface.vertices.length / 3));
    }
    const isMirrored = joints?.length && joints.every((matrix) => matrix.determinant() < 0);
    const parts = [...surfaces.values()].map(({ vertices, corners, colours }): ColouredMesh => {
      const all = corners.flat();
      return {
        vertices,
        faces: Int32Array.from(all, (_, h) => all[isMirrored ? h + 2 - 2 * (h % 3) : h]),
        colours,
      };
    });
    this.known.set(known, { parts, count });
    return { parts, count };
  }

  private vertices(number: unknown, targets: { offsets: unknown; weight: number }[]): Float64Array {
    const vertices = this.buffers.read(number, "VEC3", POSITIONS);
    for (const { offsets, weight } of targets) {
      const moves = this.rows(offsets, "VEC3", POSITIONS, vertices.length / 3);
      for (let i = 0; i < vertices.length; i++) vertices[i] += weight * moves[i];
    }
    return vertices;
  }

  /** An accessor of as many rows as there are vertices. */
  private rows(number: unknown, shape: "VEC3" | "VEC4", kinds: number[], vertices: number): Float64Array {
    const values = this.buffers.read(number, shape, kinds);
    if (values.length === vertices * (shape === "VEC3" ? 3 : 4)) return values;
    throw new MeshError(
      "bad-accessor",
      `morph targets, joints and weights must have ${vertices} rows each, as the positions have`,
    );
  }

  /** From the vertices' place in the file to that at rest, for each joint of a skin. */
  private joints(skin: Entry): Matrix4[] {
    const numbers = list(skin, "joints").map((number) => index(number, this.nodes.length, "nodes"));
    const given = skin.inverseBindMatrices;
    const inverse = given === undefined ? null : this.buffers.read(given, "MAT4", FLOATS);
    if (inverse && inverse.length < 16 * numbers.length) {
      throw new MeshError(
        "bad-accessor",
        `${numbers.length} joints have ${inverse.length / 16} inverse bind matrices`,
      );
    }
    return numbers.map((number, i) => {
      const matrix = this.matrices[number].clone();
      return inverse ? matrix.multiply(new Matrix4().fromArray(inverse, 16 * i)) : matrix;
    });
  }

  /** Vertices where their joints move them. */
  private moved(vertices: Float64Array, joints: Matrix4[], sets: [unknown, unknown][]): Float64Array {
    if (!sets.length) return vertices;
    const count = vertices.length / 3;
    const moved = new Float64Array(vertices.length);
    const point = new Vector3();
    for (const [followed, shares] of sets) {
      const numbers = this.rows(followed, "VEC4", [...INTEGERS, ...FLOATS], count);
      const weights = this.rows(shares, "VEC4", [5121, 5123, 5126], count);
      for (let i = 0; i < numbers.length; i++) {
        if (!weights[i]) continue;
        const joint = joints[index(numbers[i], joints.length, "joints")];
        const v = 3 * Math.floor(i / 4);
        point.fromArray(vertices, v).applyMatrix4(joint);
        moved[v] += weights[i] * point.x;
        moved[v + 1] += weights[i] * point.y;
        moved[v + 2] += weights[i] * point.z;
      }
    }
    return moved;
  }

  /** The corners of a primitive's triangles. */
  private corners(primitive: Entry, mode: number, vertices: number): number[] {
    const { indices } = primitive;
    if (extension(primitive, "KHR_draco_mesh_compression")) throw unsupported("what Draco packs is not read");
    const declared = indices === undefined ? vertices : item(this.document, "accessors", indices).count;
    this.faces += natural(declared, "count") / (mode === TRIANGLES ? 3 : 1);
    limit("faces", Math.floor(this.faces));
    const given = indices === undefined ? null : this.buffers.read(indices, "SCALAR", INTEGERS);
    const count = given ? given.length : vertices;
    const corner = (i: number) => (given ? given[i] : i);
    if (mode === TRIANGLES) {
      if (count % 3) {
        throw new MeshError("bad-face", `a list of triangles has ${count} corners, no multiple of three`);
      }
      return Array.from({ length: count }, (_, i) => corner(i));
    }
    return Array.from({ length: Math.max(count - 2, 0) }, (_, step) => {
      // In a strip every other triangle is wound the other way.
      const odd = step % 2;
      return mode === FAN ? [0, step + 1, step + 2] : [step + odd, step + 1 - odd, step + 2];
    })
      .flat()
      .map(corner);
  }

  private colours(number: unknown): Float32Array {
    const [shape, kinds] = [item(this.document, "accessors", number).type, [5121, 5123, 5126]];
    if (shape === "VEC3") return Float32Array.from(this.buffers.read(number, shape, kinds));
    return Float32Array.from(this.buffers.read(number, "VEC4", kinds).filter((_, i) => i % 4 < 3));
  }

  /** The transforms of a node's instances (EXT_mesh_gpu_instancing), or the identity. */
  private instances(node: Entry): Matrix4[] {
    const attributes = child(extension(node, "EXT_mesh_gpu_instancing") ?? {}, "attributes");
    const read = (name: string, shape: "VEC3" | "VEC4", kinds: number[]) =>
      attributes[name] === undefined ? null : this.buffers.read(attributes[name], shape, kinds);
    const positions = read("TRANSLATION", "VEC3", FLOATS);
    const rotations = read("ROTATION", "VEC4", [5120, 5122, 5126]);
    const scales = read("SCALE", "VEC3", FLOATS);
    const counts = [
      positions && positions.length / 3,
      rotations && rotations.length / 4,
      scales && scales.length / 3,
    ];
    const [count = 1, ...others] = counts.filter((one) => one !== null);
    if (others.some((other) => other !== count)) {
      throw new MeshError("bad-accessor", "the transforms of instances differ in number");
    }
    return Array.from({ length: count }, (_, i) =>
      composed(
        positions?.subarray(3 * i, 3 * i + 3),
        rotations?.subarray(4 * i, 4 * i + 4),
        scales?.subarray(3 * i, 3 * i + 3),
      ),
    );
  }
}

const badScene = (what: string) => new MeshError("bad-scene", `${what}; nodes must form trees`);

/** The joints and weights of a primitive's vertices. */
function skinSets(attributes: Entry): [unknown, unknown][] {
  const found: [unknown, unknown][] = [];
  for (let set = 0; set < SETS; set++) {
    const [joints, weights] = [attributes[`JOINTS_${set}`], attributes[`WEIGHTS_${set}`]];
    if (joints === undefined || weights === undefined) break;
    found.push([joints, weights]);
  }
  return found;
}

/** The node's own matrix: as it is, or of its translation, rotation and scale. */
function localMatrix(node: Entry): Matrix4 {
  if (node.matrix !== undefined) return new Matrix4().fromArray(reals(node, "matrix", 16));
  const of = (key: string, count: number) => (node[key] === undefined ? undefined : reals(node, key, count));
  return composed(of("translation", 3), of("rotation", 4), of("scale", 3));
}

function composed(
  position?: ArrayLike<number>,
  rotation?: ArrayLike<number>,
  scale?: ArrayLike<number>,
): Matrix4 {
  const [x, y, z, w] = rotation ? Array.from(rotation) : [0, 0, 0, 1];
  const length = Math.sqrt(x * x + y * y + z * z + w * w);
  if (!(length > 1e-6 && length < 1e6)) throw new MeshError("bad-number", "a rotation is no unit quaternion");
  return new Matrix4().compose(
    position ? new Vector3(...Array.from(position)) : new Vector3(),
    new Quaternion(x / length, y / length, z / length, w / length),
    scale ? new Vector3(...Array.from(scale)) : new Vector3(1, 1, 1),
  );
}
