// Polygons to triangles, as `model.loading.triangles` makes them: a convex polygon becomes a fan
// around its first corner, and ears are cut from one where the fan would overlap itself.

import { MeshError, type Mesh } from "../mesh";
import { LIMITS, limit } from "./limits";

// Of a polygon's area: what the triangles of a fan may overlap by rounding.
const ROUNDING = 1e-9;
// Times that a polygon may have corners left but none that can be cut. It happens only to one that
// crosses itself; after that its corners are cut as they come.
const MOST_STALLS = 16;

/** vertices: 3 V numbers. corners: vertex indices of all polygons one after another. counts: corners of
 * each polygon. An index that names no vertex becomes -1, which is refused later. */
export function triangulate(vertices: Float64Array, corners: number[], counts: number[]): Mesh {
  const isVertex = (corner: number) => corner >= 0 && corner < vertices.length / 3;
  const triangles = counts.reduce((sum, count) => sum + Math.max(count - 2, 0), 0);
  limit("faces", triangles);
  if (!corners.every(Number.isSafeInteger)) {
    throw new MeshError("bad-index", "a face names its vertices by something else than whole numbers");
  }
  const exist = corners.every(isVertex);
  const named = exist ? corners : corners.map((corner) => (isVertex(corner) ? corner : -1));
  const faces = new Int32Array(3 * triangles);
  let [start, place, steps] = [0, 0, 0];
  for (const count of counts) {
    const polygon = count === 3 ? null : named.slice(start, start + count);
    const outline = exist && polygon && count > 3 ? flattenConcave(vertices, polygon) : null;
    if (!polygon) {
      for (let s = 0; s < 3; s++) faces[place++] = named[start + s];
    } else if (outline) {
      const cut = cutEars(outline, LIMITS["ear steps"] - steps);
      steps += cut.steps;
      limit(
        "ear steps",
        steps,
        `its concave polygons have too many corners: to cut them takes ${steps} steps`,
      );
      for (const corner of cut.triangles) faces[place++] = polygon[corner];
    } else {
      for (let step = 0; step < count - 2; step++) {
        faces[place++] = polygon[0];
        faces[place++] = polygon[step + 1];
        faces[place++] = polygon[step + 2];
      }
    }
    start += count;
  }
  return { vertices, faces };
}

/** A polygon in 2D, counterclockwise. least: twice the least area that a triangle has. */
interface Outline {
  x: Float64Array;
  y: Float64Array;
  least: number;
}

/** The corners projected along the axis that is closest to the polygon's normal (Newell's), where the
 * triangles of a fan would overlap; else null, also for a polygon without area. */
function flattenConcave(vertices: Float64Array, polygon: number[]): Outline | null {
  const normal = [0, 0, 0];
  const crosses: number[][] = [];
  for (let step = 1; step < polygon.length - 1; step++) {
    const across = crossOf(vertices, polygon[0], polygon[step], polygon[step + 1]);
    crosses.push(across);
    for (let k = 0; k < 3; k++) normal[k] += across[k];
  }
  const overlap = crosses.reduce(
    (sum, [u, v, w]) => sum - Math.min(u * normal[0] + v * normal[1] + w * normal[2], 0),
    0,
  );
  const square = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2];
  if (!(overlap > ROUNDING * square)) return null;
  let axis = 0;
  for (const k of [1, 2]) if (Math.abs(normal[k]) > Math.abs(normal[axis])) axis = k;
  let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
  if (normal[axis] < 0) [u, v] = [v, u];
  return {
    x: Float64Array.from(polygon, (corner) => vertices[3 * corner + u]),
    y: Float64Array.from(polygon, (corner) => vertices[3 * corner + v]),
    least: ROUNDING * Math.abs(normal[axis]),
  };
}

/** The normal of a triangle, as long as twice its area. */
function crossOf(vertices: Float64Array, a: number, b: number, c: number): number[] {
  const [u, v, w] = [0, 1, 2].map((k) => vertices[3 * b + k] - vertices[3 * a + k]);
  const [x, y, z] = [0, 1, 2].map((k) => vertices[3 * c + k] - vertices[3 * a + k]);
  return [v * z - w * y, w * x - u * z, u * y - v * x];
}

/** An outline whose corners are cut. before, after: the neighbours of each corner that is left. */
interface Ring extends Outline {
  before: Int32Array;
  after: Int32Array;
}

/** The triangles of a concave polygon, 3 corners each, and the steps taken, of about a nanosecond.
 *
 * To cut one ear changes what its neighbours are, and no others, unless corners lie on one line:
 * where no ear is left, all are looked at again. To pass over the corner after each that is cut keeps
 * triangles from becoming thin. */
function cutEars(outline: Outline, mostSteps: number) {
  const count = outline.x.length;
  const before = Int32Array.from({ length: count }, (_, i) => (i || count) - 1);
  const after = Int32Array.from({ length: count }, (_, i) => (i + 1) % count);
  const ring: Ring = { ...outline, before, after };
  const ears = new Uint8Array(count);
  const triangles: number[] = [];
  let [corner, stalls, left] = [0, 0, count];
  let steps = 2 * count * count;
  let looked = false; // at all corners that are left
  while (left > 3 && steps <= mostSteps) {
    let seen = 0;
    for (; seen < left && !ears[corner]; seen++) corner = after[corner];
    if (seen === left && !looked && stalls < MOST_STALLS) {
      for (let i = 0; i < left; i++) {
        ears[corner] = Number(isEar(ring, corner));
        corner = after[corner];
      }
      steps += left * left;
      looked = true;
      continue;
    }
    if (seen === left) {
      const found = withoutEars(ring, corner, left);
      corner = found.corner;
      stalls += Number(!found.isFlat);
    }
    const [first, last] = [before[corner], after[corner]];
    triangles.push(first, corner, last);
    after[first] = last;
    before[last] = first;
    left--;
    ears[first] = Number(isEar(ring, first));
    ears[last] = Number(isEar(ring, last));
    looked = false;
    corner = after[last];
  }
  triangles.push(before[corner], corner, after[corner]);
  return { triangles, steps };
}

/** Whether the triangle of a corner has an area and holds no other part of the outline. Reflex corners
 * tell. One that meets a corner of the triangle, as where a hole is joined to the outline, does not
 * lie in it. */
function isEar(ring: Ring, corner: number): boolean {
  const { x, y, least, before, after } = ring;
  const [a, b, c] = [before[corner], corner, after[corner]];
  if (!(turn(ring, a, b, c) > least)) return false;
  const [lowX, highX] = [Math.min(x[a], x[b], x[c]), Math.max(x[a], x[b], x[c])];
  const [lowY, highY] = [Math.min(y[a], y[b], y[c]), Math.max(y[a], y[b], y[c])];
  const meets = (p: number, q: number) => x[p] === x[q] && y[p] === y[q];
  for (let p = after[c]; p !== a; p = after[p]) {
    if (
      lowX <= x[p] &&
      x[p] <= highX &&
      lowY <= y[p] &&
      y[p] <= highY &&
      turn(ring, a, b, p) >= 0 &&
      turn(ring, b, c, p) >= 0 &&
      turn(ring, c, a, p) >= 0 &&
      !(meets(p, a) || meets(p, b) || meets(p, c)) &&
      turn(ring, before[p], p, after[p]) <= least
    ) {
      return false;
    }
  }
  return true;
}

/** The corner to cut where there is no ear, and whether it has no area. One without area can be cut
 * anywhere. There is one, or else the polygon crosses itself, and no way to cut it is right: then a
 * convex one. */
function withoutEars(ring: Ring, corner: number, left: number) {
  let convex = corner;
  for (let i = 0; i < left; i++) {
    const turned = turn(ring, ring.before[corner], corner, ring.after[corner]);
    if (Math.abs(turned) <= ring.least) return { corner, isFlat: true };
    if (turned > 0) convex = corner;
    corner = ring.after[corner];
  }
  return { corner: convex, isFlat: false };
}

/** Twice the area of a triangle, positive where it is counterclockwise. */
const turn = ({ x, y }: Outline, a: number, b: number, c: number) =>
  (x[b] - x[a]) * (y[c] - y[b]) - (y[b] - y[a]) * (x[c] - x[b]);
