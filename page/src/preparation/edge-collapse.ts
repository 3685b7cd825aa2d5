// Edge collapse on half-edges, as `model.preparation.edge_collapse` does it: collapses that meet the
// link condition keep the topology of a manifold with borders.

import type { Mesh } from "../mesh";
import { cross, dot, row, subtract, type Vector } from "./geometry";
import { faceOf, nextSide, pair, previousSide } from "./halfedges";

// A face is degenerate when twice its area is at most this share of its longest side squared.
const THINNEST = 1e-6;

/** A manifold whose edges are collapsed in place. start: the vertex that each half-edge leaves, -1 in
 * faces that are gone. first: a half-edge that leaves each vertex, at a border the one with all
 * others to its left. valence: faces around each vertex. */
export interface HalfEdges {
  vertices: Float64Array;
  start: Int32Array;
  twin: Int32Array;
  first: Int32Array;
  valence: Int32Array;
  border: Uint8Array;
}

/** Copy a manifold, so that its edges can be collapsed. */
export function halfEdges({ vertices, faces }: Mesh, twin: Int32Array): HalfEdges {
  const count = vertices.length / 3;
  const first = new Int32Array(count).fill(-1);
  const valence = new Int32Array(count);
  const border = new Uint8Array(count);
  for (let h = 0; h < twin.length; h++) {
    const u = faces[h];
    valence[u]++;
    if (first[u] < 0 || twin[h] < 0) first[u] = h;
    if (twin[h] < 0) border[u] = border[faces[nextSide(h)]] = 1;
  }
  return { vertices: vertices.slice(), start: faces.slice(), twin: twin.slice(), first, valence, border };
}

/** The next half-edge to the left that leaves the same vertex, -1 behind a border. */
const turnLeft = (mesh: HalfEdges, h: number) => mesh.twin[previousSide(h)];

/** The half-edges that leave a vertex, from the first on. */
export function around(mesh: HalfEdges, u: number): number[] {
  const found = [mesh.first[u]];
  for (let g = turnLeft(mesh, found[0]); g >= 0 && g !== found[0]; g = turnLeft(mesh, g)) found.push(g);
  return found;
}

/** Whether an edge's ends have no other common neighbours than the corners across the edge. h: from u
 * to v. met: in which `attempt`, a new number each time, marks neighbours of u. */
export function meetsLinkCondition(
  mesh: HalfEdges,
  h: number,
  u: number,
  v: number,
  met: Int32Array,
  attempt: number,
): boolean {
  const { start, twin, border, valence } = mesh;
  if (twin[h] >= 0 && border[u] && border[v]) return false;
  for (const g of around(mesh, u)) {
    met[start[g]] = met[start[nextSide(g)]] = met[start[previousSide(g)]] = attempt;
  }
  let common = 0;
  let last = -1;
  for (const g of around(mesh, v)) {
    common += Number(met[start[nextSide(g)]] === attempt);
    last = previousSide(g);
  }
  if (twin[last] < 0) common += Number(met[start[last]] === attempt);
  // u itself is one of those that were met.
  if (twin[h] < 0) {
    const alone = twin[nextSide(h)] < 0 && twin[previousSide(h)] < 0;
    return common === 2 && !alone;
  }
  const tetrahedron = valence[u] === 3 && valence[v] === 3;
  return common === 3 && (Boolean(border[u] || border[v]) || !tetrahedron);
}

/** What becomes of the faces around a vertex that moves. */
export const [SOUND, TURNED, DEGENERATE] = [0, 1, 2];

/** Whether a face at u, but not at v, turns over or becomes degenerate as u moves. */
export function effectOfMoving(mesh: HalfEdges, u: number, v: number, place: Vector): number {
  let effect = SOUND;
  for (const g of around(mesh, u)) {
    const [x, y] = [mesh.start[nextSide(g)], mesh.start[previousSide(g)]];
    if (x === v || y === v) continue;
    const corner = row(mesh.vertices, x);
    const [edge, side] = [subtract(row(mesh.vertices, y), corner), subtract(place, corner)];
    const before = cross(edge, subtract(row(mesh.vertices, u), corner));
    const after = cross(edge, side);
    const least = THINNEST * Math.max(dot(edge, edge), dot(side, side));
    if (dot(after, after) <= least * least) return DEGENERATE;
    if (dot(before, after) <= 0) effect = TURNED;
  }
  return effect;
}

/** Remove vertex v and the faces at h, which runs from u to v; u takes the place of v. Returns the
 * number of faces that went, one at a border. */
export function collapseEdge(mesh: HalfEdges, h: number, u: number, v: number): number {
  const { start, twin, first, valence, border } = mesh;
  const t = twin[h];
  for (const g of around(mesh, v)) start[g] = u;
  // The corners across the edge, w left of it and x right of it, and the half-edges outside: from w
  // to v, from u to w, from x to u, from v to x.
  const [w, wv, uw] = [start[previousSide(h)], twin[nextSide(h)], twin[previousSide(h)]];
  pair(twin, wv, uw);
  if (faceOf(first[w]) === faceOf(h)) first[w] = wv;
  valence[w]--;
  valence[u] += valence[v] - 2;
  let leaving = border[v] ? first[v] : first[u];
  if (faceOf(leaving) === faceOf(h) || leaving === t) leaving = uw;
  if (t >= 0) {
    const [x, xu, vx] = [start[previousSide(t)], twin[nextSide(t)], twin[previousSide(t)]];
    pair(twin, xu, vx);
    if (faceOf(first[x]) === faceOf(t)) first[x] = xu;
    valence[x]--;
    valence[u] -= 2;
    if (leaving === nextSide(t)) leaving = vx;
    start[t] = start[nextSide(t)] = start[previousSide(t)] = -1;
  }
  start[h] = start[nextSide(h)] = start[previousSide(h)] = -1;
  first[u] = leaving;
  border[u] |= border[v];
  return t >= 0 ? 2 : 1;
}
