// The score of a class, distributed over the faces of a file, as `model.attribution` does it.

import type { Mesh } from "../mesh";

/** What each face of a level gathered: rows of `width` numbers of faces from 1, or 0 for none. */
export interface Pool {
  indices: Int32Array;
  width: number;
}

// The least area of a face, as a share of its mesh's: in shares of a score, and in densities.
const NO_AREA = 1e-15;
const LEAST_AREA = 1e-12;
// Share of the surface within the range of the colour map; the rest has its last colours.
const SHOWN_SHARE = 0.95;

/** Contributions of the faces of a prepared mesh, from the evidence of the last level's faces. */
export function contributions(evidence: Float64Array, pools: Pool[], faces: Int32Array): Float64Array {
  let shares = evidence.map((value) => value / evidence.length);
  let reached = new Uint8Array(shares.length).fill(1);
  for (let level = pools.length - 1; level >= 0; level--) {
    const count = level ? pools[level - 1].indices.length / pools[level - 1].width : faces.length / 3;
    const below = new Float64Array(count);
    const reachedBelow = new Uint8Array(count);
    const { indices, width } = pools[level];
    for (let row = 0; row < shares.length; row++) {
      const gathered = indices.subarray(row * width, (row + 1) * width).filter((face) => face > 0);
      for (const face of gathered) {
        below[face - 1] += shares[row] / gathered.length;
        reachedBelow[face - 1] |= reached[row];
      }
    }
    [shares, reached] = [below, reachedBelow];
  }
  return shareWithUnreached(shares, reached, neighbours(faces));
}

/** Pairs of faces that share an edge, both ways. */
function neighbours(faces: Int32Array): [number, number][] {
  const over = new Map<string, number[]>();
  for (let h = 0; h < faces.length; h++) {
    const [a, b] = [faces[h], faces[h % 3 === 2 ? h - 2 : h + 1]];
    const key = a < b ? `${a} ${b}` : `${b} ${a}`;
    if (!over.get(key)?.push(h)) over.set(key, [h]);
  }
  return [...over.values()]
    .filter((both) => both.length === 2)
    .map((both) => both.map((h) => Math.floor(h / 3)))
    .flatMap(([f, g]): [number, number][] => [
      [f, g],
      [g, f],
    ]);
}

/** Ring by ring, each face with a share splits it among itself and its neighbours without one. */
function shareWithUnreached(
  shares: Float64Array,
  reached: Uint8Array,
  pairs: [number, number][],
): Float64Array {
  for (;;) {
    const gives = pairs.filter(([face, other]) => reached[face] && !reached[other]);
    if (!gives.length) return shares;
    const parts = new Float64Array(shares.length).fill(1);
    for (const [face] of gives) parts[face]++;
    const each = shares.map((share, face) => share / parts[face]);
    shares = each.slice();
    for (const [face, other] of gives) {
      shares[other] += each[face];
      reached[other] = 1;
    }
  }
}

/** Contributions of the faces of a file, from those of the prepared mesh in its coordinates. */
export function ontoFile(shares: Float64Array, prepared: Mesh, file: Mesh): Float64Array {
  const owner = nearestFaces(centroids(file), prepared);
  const areas = areasOf(file);
  const least = sum(areas) * NO_AREA;
  const owned = new Float64Array(shares.length);
  for (let f = 0; f < areas.length; f++) {
    areas[f] = Math.max(areas[f], least);
    owned[owner[f]] += areas[f];
  }
  const added = areas.map((area, f) => (area * shares[owner[f]]) / owned[owner[f]]);
  const alone = Array.from(owned.keys()).filter((face) => owned[face] === 0);
  const middles = centroids(prepared);
  const points = Float64Array.from(alone.flatMap((f) => [...middles.subarray(3 * f, 3 * f + 3)]));
  nearestFaces(points, file).forEach((taker, i) => (added[taker] += shares[alone[i]]));
  return added;
}

/** Contributions by share of the area, and that of the last colours. */
export function densitiesOf(added: Float64Array, file: Mesh): { densities: Float64Array; limit: number } {
  const areas = areasOf(file);
  const total = sum(areas);
  const densities = added.map((value, f) => value / Math.max(areas[f] / total, LEAST_AREA));
  const order = Float64Array.from(areas.keys()).sort(
    (a, b) => Math.abs(densities[a]) - Math.abs(densities[b]),
  );
  let covered = 0;
  const last = order.find((f) => (covered += areas[f]) >= SHOWN_SHARE * total);
  return { densities, limit: Math.abs(densities[last ?? order[order.length - 1]]) };
}

const sum = (values: Float64Array) => values.reduce((total, value) => total + value, 0);

function centroids({ vertices, faces }: Mesh): Float64Array {
  const middles = new Float64Array(faces.length);
  for (let f = 0; f < faces.length; f += 3) {
    for (let k = 0; k < 3; k++) {
      const [a, b, c] = [0, 1, 2].map((s) => vertices[3 * faces[f + s] + k]);
      middles[f + k] = (a + b + c) / 3;
    }
  }
  return middles;
}

function areasOf({ vertices, faces }: Mesh): Float64Array {
  const areas = new Float64Array(faces.length / 3);
  for (let f = 0; f < areas.length; f++) {
    const [a, b, c] = [3 * faces[3 * f], 3 * faces[3 * f + 1], 3 * faces[3 * f + 2]];
    const [ux, uy, uz] = [0, 1, 2].map((k) => vertices[b + k] - vertices[a + k]);
    const [vx, vy, vz] = [0, 1, 2].map((k) => vertices[c + k] - vertices[a + k]);
    areas[f] = Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx) / 2;
  }
  return areas;
}

/** The face of a mesh that is nearest to each point. Measures those whose bounding spheres are
 * nearer than the nearest so far, from that of the point before, which is often the next to it. */
function nearestFaces(points: Float64Array, mesh: Mesh): Int32Array {
  const { vertices, faces } = mesh;
  const count = faces.length / 3;
  const centres = centroids(mesh);
  const radii = new Float64Array(count);
  for (let h = 0; h < faces.length; h++) {
    const f = Math.floor(h / 3);
    const [x, y, z] = [0, 1, 2].map((k) => vertices[3 * faces[h] + k] - centres[3 * f + k]);
    radii[f] = Math.max(radii[f], Math.hypot(x, y, z));
  }
  const nearest = new Int32Array(points.length / 3);
  let last = 0;
  for (let i = 0; i < nearest.length; i++) {
    const [x, y, z] = [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
    let best = Infinity;
    for (let k = -1; k < count; k++) {
      const f = k < 0 ? last : k;
      const [dx, dy, dz] = [centres[3 * f] - x, centres[3 * f + 1] - y, centres[3 * f + 2] - z];
      if (dx * dx + dy * dy + dz * dz > (best + radii[f]) ** 2) continue;
      const distance = distanceFrom(x, y, z, vertices, faces, f);
      if (distance < best || (distance === best && f < nearest[i])) {
        best = distance;
        nearest[i] = f;
      }
    }
    last = nearest[i];
  }
  return nearest;
}

/** Distance of a point from a face. */
function distanceFrom(
  x: number,
  y: number,
  z: number,
  vertices: Float64Array,
  faces: Int32Array,
  face: number,
): number {
  const corners = [0, 1, 2].map((s) => 3 * faces[3 * face + s]);
  const [a, b, c] = corners.map((i) => [vertices[i], vertices[i + 1], vertices[i + 2]]);
  const point = [x, y, z];
  const normal = cross(minus(b, a), minus(c, a));
  let above = dot(normal, normal) > 0;
  let square = Infinity;
  for (const [start, end] of [
    [a, b],
    [b, c],
    [c, a],
  ]) {
    const [edge, away] = [minus(end, start), minus(point, start)];
    above &&= dot(cross(normal, edge), away) >= 0;
    const along = Math.min(Math.max(dot(edge, away) / Math.max(dot(edge, edge), 1e-300), 0), 1);
    const rest = minus(away, edge.map((part) => part * along));
    square = Math.min(square, dot(rest, rest));
  }
  return above ? Math.abs(dot(normal, minus(point, a))) / Math.sqrt(dot(normal, normal)) : Math.sqrt(square);
}

const minus = (a: number[], b: number[]) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a: number[], b: number[]) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a: number[], b: number[]) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
