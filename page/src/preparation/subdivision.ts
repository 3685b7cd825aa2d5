// Subdivision of a mesh with too few faces, as `model.preparation.subdivision` does it: flat parts are
// triangulated anew, then longest edges are split at their middle.

import type { Mesh } from "../mesh";
import { cross, dot, length, row, subtract } from "./geometry";
import { faceOf, findTwins, nextSide, pair, previousSide, sortedBy } from "./halfedges";

// Of the angle between the normals of two faces that are flat together, its cosine below 1.
const FLAT = 1e-6;
// Of the sine of an angle: what is left to rounding.
const ROUNDING = 1e-9;

/** Split longest edges at their middle, from below, to `budget` faces or one less. Vertices stay the
 * first. */
export function subdivide({ vertices, faces }: Mesh, budget: number): Mesh {
  const flipped = faces.slice();
  flipFlatEdges(vertices, flipped, findTwins(faces, vertices.length / 3).twin);
  const ordered = inOrder(flipped, vertices.length / 3);
  const room = budget - faces.length / 3;
  const halves = new Halves(ordered, findTwins(ordered, vertices.length / 3).twin, vertices, room);
  halves.bisect(budget);
  return halves.mesh();
}

/** Each face from its first vertex on, and faces by their corners. */
function inOrder(faces: Int32Array, vertexCount: number): Int32Array {
  const sides = [0, 1, 2].map(() => new Int32Array(faces.length / 3));
  for (let f = 0; f < sides[0].length; f++) {
    const face = faces.subarray(3 * f, 3 * f + 3);
    const first = face.indexOf(Math.min(...face));
    for (let s = 0; s < 3; s++) sides[s][f] = face[(first + s) % 3];
  }
  const order = sortedBy(sides, vertexCount);
  return faces.map((_, h) => sides[h % 3][order[faceOf(h)]]);
}

/** Make the flat parts of an oriented manifold Delaunay, in place. */
function flipFlatEdges(vertices: Float64Array, faces: Int32Array, twin: Int32Array): void {
  for (let pass = 0; pass < faces.length / 3; pass++) {
    let flips = 0;
    for (let h = 0; h < twin.length; h++) {
      if (twin[h] > h && isToFlip(vertices, faces, h, twin[h])) {
        flip(faces, twin, h, twin[h]);
        flips++;
      }
    }
    if (flips === 0) break;
  }
}

function isToFlip(vertices: Float64Array, faces: Int32Array, h: number, t: number): boolean {
  const [a, b, c] = [faces[h], faces[nextSide(h)], faces[previousSide(h)]];
  const d = faces[previousSide(t)];
  if (faces[t] !== b || c === d || isEdge(faces, c, d)) return false;
  const [pa, pb, pc, pd] = [a, b, c, d].map((v) => row(vertices, v));
  const [ca, cb, da, db] = [subtract(pa, pc), subtract(pb, pc), subtract(pa, pd), subtract(pb, pd)];
  const [one, other] = [cross(ca, cb), cross(db, da)];
  if (dot(one, other) < (1 - FLAT) * length(one) * length(other)) return false;
  // Sine of the sum of the angles at c and d, times the lengths of their sides.
  const sine = length(one) * dot(da, db) + length(other) * dot(ca, cb);
  return sine < -ROUNDING * length(ca) * length(cb) * length(da) * length(db);
}

function isEdge(faces: Int32Array, c: number, d: number): boolean {
  for (let h = 0; h < faces.length; h++) {
    const [a, b] = [faces[h], faces[nextSide(h)]];
    if ((a === c && b === d) || (a === d && b === c)) return true;
  }
  return false;
}

/** Replace the edge of half-edges h and t by the other diagonal of its two faces. */
function flip(faces: Int32Array, twin: Int32Array, h: number, t: number): void {
  const [a, b, c] = [faces[h], faces[nextSide(h)], faces[previousSide(h)]];
  const d = faces[previousSide(t)];
  const [f, g] = [3 * faceOf(h), 3 * faceOf(t)];
  const [after, before] = [twin[nextSide(h)], twin[previousSide(h)]];
  const [afterTwin, beforeTwin] = [twin[nextSide(t)], twin[previousSide(t)]];
  faces.set([d, c, a], f);
  faces.set([c, d, b], g);
  pair(twin, f, g);
  hinge(twin, f + 1, before);
  hinge(twin, f + 2, afterTwin);
  hinge(twin, g + 1, beforeTwin);
  hinge(twin, g + 2, after);
}

/** Make `other` the twin of h; -1 is a border. */
function hinge(twin: Int32Array, h: number, other: number): void {
  twin[h] = other;
  if (other >= 0) twin[other] = h;
}

/** A mesh whose edges are halved, with room for more faces and vertices. */
class Halves {
  private readonly vertices: Float64Array;
  private readonly faces: Int32Array;
  private readonly twin: Int32Array;
  private readonly lengths: Float32Array;
  private vertexCount: number;
  private faceCount: number;

  constructor(faces: Int32Array, twin: Int32Array, vertices: Float64Array, room: number) {
    this.vertexCount = vertices.length / 3;
    this.faceCount = faces.length / 3;
    this.vertices = new Float64Array(vertices.length + 3 * room);
    this.faces = new Int32Array(faces.length + 3 * room);
    this.twin = new Int32Array(this.faces.length).fill(-1);
    this.lengths = new Float32Array(this.faces.length);
    this.vertices.set(vertices);
    this.faces.set(faces);
    this.twin.set(twin);
    for (let f = 0; f < this.faceCount; f++) this.measure(f);
  }

  mesh(): Mesh {
    return {
      vertices: this.vertices.slice(0, 3 * this.vertexCount),
      faces: this.faces.slice(0, 3 * this.faceCount),
    };
  }

  /** Bisect longest edges while an inner edge's two new faces have room. */
  bisect(budget: number): void {
    const { vertices, faces, twin } = this;
    while (this.faceCount + 2 <= budget) {
      const h = this.longest();
      const t = twin[h];
      const [start, end] = [faces[h], faces[nextSide(h)]];
      const middle = this.vertexCount++;
      for (let k = 0; k < 3; k++) {
        vertices[3 * middle + k] = (vertices[3 * start + k] + vertices[3 * end + k]) / 2;
      }
      const far = this.splitFace(h, middle);
      if (t < 0) continue;
      const alike = faces[t] === start;
      const farTwin = this.splitFace(t, middle);
      pair(twin, h, alike ? t : farTwin);
      pair(twin, far, alike ? farTwin : t);
    }
  }

  /** The longest half-edge, of equal ones the first. */
  private longest(): number {
    let longest = 0;
    for (let h = 1; h < 3 * this.faceCount; h++) if (this.lengths[h] > this.lengths[longest]) longest = h;
    return longest;
  }

  /** Cut h's face from the middle of h to the corner across; the far half is a new face. h keeps the
   * near half of the edge; returns the half-edge of the far one. Neither has a twin yet. */
  private splitFace(h: number, middle: number): number {
    const { faces, twin } = this;
    const added = this.faceCount++;
    const after = nextSide(h);
    faces.set([middle, faces[after], faces[previousSide(h)]], 3 * added);
    faces[after] = middle;
    hinge(twin, 3 * added + 1, twin[after]);
    hinge(twin, 3 * added + 2, after);
    twin[h] = -1;
    this.measure(faceOf(h));
    this.measure(added);
    return 3 * added;
  }

  /** Squared lengths of a face's sides, to seven digits: the halves of a split edge are equally long,
   * and rounding would tell them apart. */
  private measure(f: number): void {
    for (let h = 3 * f; h < 3 * f + 3; h++) {
      const step = subtract(row(this.vertices, this.faces[h]), row(this.vertices, this.faces[nextSide(h)]));
      this.lengths[h] = dot(step, step);
    }
  }
}
