// Objects of 3MF and AMF: meshes, and groups that place others.

import { Matrix4 } from "three";
import { MeshError, type Mesh } from "../mesh";
import { limit } from "./limits";
import { flatten, type Placed } from "./scene";
import { quoted } from "./text";

/** What an item or component places. key: of the object. */
export interface Reference {
  key: string;
  matrix: Matrix4;
}

/** A mesh, or a group of components. leftOut: first and last of each run of triangles that are not part
 * of the shape. */
export class MeshObject {
  readonly vertices: number[] = [];
  readonly corners: number[] = [];
  components: Reference[] = [];
  readonly leftOut: [number, number][] = [];
  isSupport = false;

  mesh(): Mesh {
    const isLeftOut = new Uint8Array(this.corners.length / 3);
    for (const [first, last] of this.leftOut) isLeftOut.fill(1, first, last + 1);
    const corners = this.corners.filter((_, h) => !isLeftOut[Math.floor(h / 3)]);
    // Not to be wrapped into an index that exists.
    const count = this.vertices.length / 3;
    const faces = Int32Array.from(corners, (corner) => (corner >= 0 && corner < count ? corner : -1));
    return { vertices: Float64Array.from(this.vertices), faces };
  }
}

/** The triangles of every object that is placed; components are resolved. */
export function placedObjects(objects: Map<string, MeshObject>, build: Reference[]): Mesh {
  const meshes = new Map<string, Mesh>();
  const placed: Placed[] = [];
  const inside = new Set<string>();
  // References, and keys of those in which all is done.
  const waiting: (Reference | string)[] = build.toReversed();
  let references = build.length;
  for (let step = waiting.pop(); step !== undefined; step = waiting.pop()) {
    if (typeof step === "string") {
      inside.delete(step);
      continue;
    }
    const { key, matrix } = step;
    const found = objects.get(key);
    if (!found) throw new MeshError("bad-reference", `object ${quoted(key)} does not exist`);
    if (inside.has(key)) throw new MeshError("bad-scene", `object ${quoted(key)} contains itself`);
    if (found.isSupport) continue;
    if (found.vertices.length || !found.components.length) {
      const part = meshes.get(key) ?? found.mesh();
      meshes.set(key, part);
      placed.push({ part, matrix });
      continue;
    }
    references += found.components.length;
    limit("geometries", references);
    inside.add(key);
    waiting.push(key);
    for (const inner of found.components.toReversed()) {
      waiting.push({ key: inner.key, matrix: new Matrix4().multiplyMatrices(matrix, inner.matrix) });
    }
  }
  return flatten(placed);
}
