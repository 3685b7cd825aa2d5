// The score of a class, distributed over the faces of a file, as `model.attribution` does it.

import type { Mesh } from "../mesh";
import { faceAreas, faceGeometry, sum } from "../preparation/geometry";
import { faceOf, findTwins } from "../preparation/halfedges";

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
  const { twin } = findTwins(faces, Math.max(...faces) + 1);
  return [...twin].flatMap((other, h): [number, number][] => (other < 0 ? [] : [[faceOf(h), faceOf(other)]]));
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
  const areas = faceAreas(file.vertices, file.faces);
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
  const areas = faceAreas(file.vertices, file.faces);
  const total = sum(areas);
  const densities = added.map((value, f) => value / Math.max(areas[f] / total, LEAST_AREA));
  const order = Float64Array.from(areas.keys()).sort(
    (a, b) => Math.abs(densities[a]) - Math.abs(densities[b]),
  );
  let covered = 0;
  const last = order.find((f) => (covered += areas[f]) >= SHOWN_SHARE * total);
  return { densities, limit: Math.abs(densities[last ?? order[order.length - 1]]) };
}

const centroids = ({ vertices, faces }: Mesh) =>
  faceGeometry(vertices, faces).cornerSums.map((value) => value / 3);

/** The face of a mesh that is nearest to each point. Measures those whose bounding spheres are
 * nearer than the nearest so far, from that of the point before, which is often the next to it. */
function nearestFaces(points: Float64Array, mesh: Mesh): Int32Array {
  const triangles = trianglesOf(mesh);
  const count = mesh.faces.length / 3;
  const centres = centroids(mesh);
  const radii = new Float64Array(count);
  for (let h = 0; h < mesh.faces.length; h++) {
    const f = faceOf(h);
    const [dx, dy, dz] = [0, 1, 2].map((k) => triangles[3 * h + k] - centres[3 * f + k]);
    radii[f] = Math.max(radii[f], Math.hypot(dx, dy, dz));
  }
  const nearest = new Int32Array(points.length / 3);
  let last = 0;
  for (let i = 0; i < nearest.length; i++) {
    const x = points[3 * i];
    const y = points[3 * i + 1];
    const z = points[3 * i + 2];
    let best = Infinity;
    for (let k = -1; k < count; k++) {
      const f = k < 0 ? last : k;
      const dx = centres[3 * f] - x;
      const dy = centres[3 * f + 1] - y;
      const dz = centres[3 * f + 2] - z;
      if (dx * dx + dy * dy + dz * dz > (best + radii[f]) ** 2) continue;
      const distance = distanceFrom(x, y, z, triangles, 9 * f);
      if (distance < best || (distance === best && f < nearest[i])) {
        best = distance;
        nearest[i] = f;
      }
    }
    last = nearest[i];
  }
  return nearest;
}

/** The corners of each face, 9 numbers. */
function trianglesOf({ vertices, faces }: Mesh): Float64Array {
  const triangles = new Float64Array(3 * faces.length);
  for (let h = 0; h < faces.length; h++) {
    for (let k = 0; k < 3; k++) triangles[3 * h + k] = vertices[3 * faces[h] + k];
  }
  return triangles;
}

/** Distance of a point from the triangle at a place. Without arrays: it is called a million times. */
function distanceFrom(x: number, y: number, z: number, p: Float64Array, at: number): number {
  const ux = p[at + 3] - p[at];
  const uy = p[at + 4] - p[at + 1];
  const uz = p[at + 5] - p[at + 2];
  const vx = p[at + 6] - p[at];
  const vy = p[at + 7] - p[at + 1];
  const vz = p[at + 8] - p[at + 2];
  const nx = uy * vz - uz * vy;
  const ny = uz * vx - ux * vz;
  const nz = ux * vy - uy * vx;
  const size = nx * nx + ny * ny + nz * nz;
  let above = size > 0;
  let square = Infinity;
  for (let s = 0; s < 9; s += 3) {
    const a = at + s;
    const b = at + ((s + 3) % 9);
    const ex = p[b] - p[a];
    const ey = p[b + 1] - p[a + 1];
    const ez = p[b + 2] - p[a + 2];
    const dx = x - p[a];
    const dy = y - p[a + 1];
    const dz = z - p[a + 2];
    const side = (ny * ez - nz * ey) * dx + (nz * ex - nx * ez) * dy + (nx * ey - ny * ex) * dz;
    above = above && side >= 0;
    const along = (ex * dx + ey * dy + ez * dz) / Math.max(ex * ex + ey * ey + ez * ez, 1e-300);
    const share = Math.min(Math.max(along, 0), 1);
    const rx = dx - ex * share;
    const ry = dy - ey * share;
    const rz = dz - ez * share;
    square = Math.min(square, rx * rx + ry * ry + rz * rz);
  }
  if (!above) return Math.sqrt(square);
  return Math.abs(nx * (x - p[at]) + ny * (y - p[at + 1]) + nz * (z - p[at + 2])) / Math.sqrt(size);
}
