// From triangles as found to an oriented manifold, as `model.preparation.cleaning` makes it.

import { MeshError, type Mesh } from "../mesh";
import {
  corners,
  cross,
  dot,
  faceGeometry,
  length,
  subtract,
  surfaceCentroid,
  write,
  type Vector,
} from "./geometry";
import { faceOf, findTwins, nextSide, pairEdges, previousSide, sortedBy, sortEdges } from "./halfedges";
import { findWalls } from "./shell";

// Steps along the longest side of the unit box, to which vertices are welded, and their shift: an
// irrational number, so that coordinates of few digits lie between no two.
const GRID_STEPS = 2 ** 20;
const GRID_SHIFT = (Math.SQRT2 - 1) / 2;
const DIGIT = 2 ** 11;
// A triangle is degenerate when twice its area is below this share of its longest edge squared.
const FLATNESS = 1e-10;
// Least volume over area^1.5 of an open and of a closed component that has an outside.
const OPEN_VOLUME = 1e-3;
const CLOSED_VOLUME = 1e-12;

/** What cleaning counts, of a mesh report. */
export interface Counts {
  vertices_in: number;
  vertices_merged: number;
  degenerate_dropped: number;
  duplicates_dropped: number;
  walls_dropped: number;
  nonmanifold_edges: number;
  vertices_split: number;
  flipped: number;
  components: number;
  border_edges: number;
  watertight: boolean;
}

/** An oriented manifold, possibly with borders, in the unit box, whose lowest corner and side in the
 * file are `corner` and `size`. component: the part of each face. */
export interface CleanSurface extends Mesh {
  counts: Counts;
  twin: Int32Array;
  component: Int32Array;
  corner: Vector;
  size: number;
}

/** Weld, drop what has no area or is there twice, separate what only touches, orient. Throws
 * MeshError where no face has an area. */
export function clean(mesh: Mesh): CleanSurface {
  const welded = weld(mesh);
  let { vertices } = welded;
  const sound = dropDegenerate(vertices, welded.faces);
  if (sound.length === 0) {
    throw new MeshError(
      "no-area",
      `none of the ${mesh.faces.length / 3} faces has an area: all are lines or ` +
        "points; export the surface, in units in which it does not vanish",
    );
  }
  let { faces, winding } = mergeDuplicates(sound, vertices.length / 3);
  const duplicates = (sound.length - faces.length) / 3;
  const edges = sortEdges(faces, vertices.length / 3);
  let { twin, border, nonmanifold } = pairEdges(edges);
  const counted = nonmanifold;
  let walls = 0;
  if (nonmanifold) {
    const enclosed = findWalls(vertices, faces, edges);
    walls = enclosed.reduce((count, is) => count + is, 0);
    if (walls) {
      faces = faces.filter((_, h) => !enclosed[faceOf(h)]);
      winding = winding.filter((_, f) => !enclosed[f]);
      ({ twin, border, nonmanifold } = findTwins(faces, vertices.length / 3));
    }
  }
  let { component, flip, components } = spreadOrientation(faces, twin);
  const cuts = cutOneSided(faces, twin, flip);
  const split = splitVertices(vertices, faces, twin);
  ({ vertices, faces } = split);
  turnFaces(faces, twin, flip);
  if (nonmanifold || cuts) {
    // Where surfaces came apart, two faces of one may still share the edge.
    ({ twin, border } = findTwins(faces, vertices.length / 3));
    ({ component, components } = spreadOrientation(faces, twin));
  }
  for (let f = 0; f < winding.length; f++) if (flip[f]) winding[f] = -winding[f];
  const inward = faceInward(vertices, faces, twin, component, components, winding);
  let flipped = 0;
  // `winding` has been turned once, by `flip`.
  for (let f = 0; f < winding.length; f++) flipped += Number((inward[f] ? -winding[f] : winding[f]) < 0);
  turnFaces(faces, twin, inward);
  const counts = {
    vertices_in: welded.used,
    vertices_merged: welded.used - welded.vertices.length / 3,
    degenerate_dropped: (mesh.faces.length - sound.length) / 3,
    duplicates_dropped: duplicates,
    walls_dropped: walls,
    nonmanifold_edges: counted,
    vertices_split: split.copies,
    flipped,
    components,
    border_edges: border,
    watertight: border === 0,
  };
  return { vertices, faces, counts, twin, component, corner: welded.corner, size: welded.size };
}

/** Move the used vertices into the unit box, to its grid, and merge those on one point. They come
 * sorted by their coordinates; used: how many there were. */
function weld({ vertices, faces }: Mesh) {
  const { numbers, used } = numberUsed(vertices.length / 3, faces);
  const low: Vector = [Infinity, Infinity, Infinity];
  const high: Vector = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < vertices.length; i++) {
    if (numbers[faceOf(i)] < 0) continue;
    const k = i % 3;
    if (vertices[i] < low[k]) low[k] = vertices[i];
    if (vertices[i] > high[k]) high[k] = vertices[i];
  }
  const size = Math.max(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  const steps = low.map(() => new Int32Array(used));
  for (let i = 0; i < vertices.length; i++) {
    const [number, k] = [numbers[faceOf(i)], i % 3];
    if (number >= 0) steps[k][number] = rint(((vertices[i] - low[k]) / size) * GRID_STEPS + GRID_SHIFT);
  }
  const [x, y, z] = steps;
  const order = sortedBy(steps.flatMap(digits), DIGIT);
  const points = new Float64Array(3 * used);
  const mergedInto = new Int32Array(used);
  let count = 0;
  for (let place = 0; place < used; place++) {
    const [v, last] = [order[place], order[place - 1]];
    if (place === 0 || x[v] !== x[last] || y[v] !== y[last] || z[v] !== z[last]) {
      write(points, count++, [x[v] / GRID_STEPS, y[v] / GRID_STEPS, z[v] / GRID_STEPS]);
    }
    mergedInto[v] = count - 1;
  }
  return {
    vertices: points.slice(0, 3 * count),
    faces: faces.map((v) => mergedInto[numbers[v]]),
    used,
    corner: low,
    size,
  };
}

/** Coordinates in steps as two digits each, by which they are sorted faster. */
const digits = (steps: Int32Array) => [
  steps.map((step) => Math.floor(step / DIGIT)),
  steps.map((step) => step % DIGIT),
];

/** The nearest whole number, of two the even one. */
function rint(value: number): number {
  const nearest = Math.round(value);
  return nearest - value === 0.5 && nearest % 2 ? nearest - 1 : nearest;
}

/** The place of each vertex among those that faces use, -1 for others, and how many these are. */
function numberUsed(count: number, faces: Int32Array) {
  const numbers = new Int32Array(count).fill(-1);
  for (const v of faces) numbers[v] = 0;
  let used = 0;
  for (let v = 0; v < count; v++) if (numbers[v] === 0) numbers[v] = used++;
  return { numbers, used };
}

/** Faces that name three vertices and have a height. */
function dropDegenerate(vertices: Float64Array, faces: Int32Array): Int32Array {
  const sound = new Int32Array(faces.length);
  let count = 0;
  for (let f = 0; f < faces.length / 3; f++) {
    const [a, b, c] = corners(vertices, faces, f);
    const [ab, bc, ac] = [subtract(b, a), subtract(c, b), subtract(c, a)];
    const longest = Math.max(dot(ab, ab), dot(bc, bc), dot(ac, ac));
    if (length(cross(ab, ac)) > FLATNESS * longest) {
      sound.set(faces.subarray(3 * f, 3 * f + 3), count);
      count += 3;
    }
  }
  return sound.slice(0, count);
}

/** Drop the vertices that no face uses, keeping the order of the others. */
export function dropUnused(vertices: Float64Array, faces: Int32Array): Mesh {
  const { numbers } = numberUsed(vertices.length / 3, faces);
  return {
    vertices: vertices.filter((_, i) => numbers[faceOf(i)] >= 0),
    faces: faces.map((v) => numbers[v]),
  };
}

/** One face for those over the same three vertices, with ascending corners, in ascending order.
 * winding: whether the file wound them so (1), the other way (-1), or as often both (0). */
function mergeDuplicates(faces: Int32Array, vertexCount: number) {
  const sides = [0, 1, 2].map(() => new Int32Array(faces.length / 3));
  const [low, middle, high] = sides;
  const upwards = new Int8Array(low.length);
  for (let f = 0; f < low.length; f++) {
    const [a, b, c] = [faces[3 * f], faces[3 * f + 1], faces[3 * f + 2]];
    low[f] = Math.min(a, b, c);
    high[f] = Math.max(a, b, c);
    middle[f] = a + b + c - low[f] - high[f];
    // A triangle is wound as its sorted corners if it runs upwards over two of its sides.
    upwards[f] = Number(a < b) + Number(b < c) + Number(c < a) === 2 ? 1 : -1;
  }
  const order = sortedBy(sides, vertexCount);
  const merged = new Int32Array(faces.length);
  const votes = new Int32Array(low.length);
  let count = 0;
  let last = -1;
  for (let i = 0; i < order.length; i++) {
    const f = order[i];
    if (last < 0 || low[f] !== low[last] || middle[f] !== middle[last] || high[f] !== high[last]) {
      write(merged, count++, [low[f], middle[f], high[f]]);
    }
    votes[count - 1] += upwards[f];
    last = f;
  }
  return { faces: merged.slice(0, 3 * count), winding: Int8Array.from(votes.subarray(0, count), Math.sign) };
}

/** Give every fan of faces around a vertex a vertex of its own. Around a non-manifold edge, whose
 * half-edges have no twin, every fan ends at that edge. */
function splitVertices(vertices: Float64Array, faces: Int32Array, twin: Int32Array) {
  const split = new Int32Array(faces.length).fill(-1);
  const origin = new Int32Array(faces.length);
  const hasFan = new Uint8Array(vertices.length / 3);
  let count = 0;
  let copies = 0;
  for (let h = 0; h < faces.length; h++) {
    if (split[h] >= 0) continue;
    const v = faces[h];
    origin[count] = v;
    copies += hasFan[v];
    hasFan[v] = 1;
    split[h] = count;
    // From face to face across both sides of the corner, to a border or once around.
    for (const start of [h, previousSide(h)]) {
      let t = twin[start];
      while (t >= 0) {
        const corner = faces[t] === v ? t : nextSide(t);
        if (split[corner] >= 0) break;
        split[corner] = count;
        t = twin[corner === t ? previousSide(t) : corner];
      }
    }
    count++;
  }
  const places = new Float64Array(3 * count);
  for (let i = 0; i < places.length; i++) places[i] = vertices[3 * origin[faceOf(i)] + (i % 3)];
  return { vertices: places, faces: split, copies };
}

/** Cut a one-sided surface (a Moebius strip) in place, where it runs against itself. */
function cutOneSided(faces: Int32Array, twin: Int32Array, flip: Uint8Array): number {
  let cuts = 0;
  for (let h = 0; h < twin.length; h++) {
    const t = twin[h];
    if (t < 0) continue;
    // Two faces wound alike run along their shared edge in opposite directions.
    if (Number(faces[h] === faces[t]) ^ flip[faceOf(h)] ^ flip[faceOf(t)]) {
      twin[h] = -1;
      cuts++;
    }
  }
  return cuts;
}

/** Component of every face, whether it is wound against its first face, and their number. */
function spreadOrientation(faces: Int32Array, twin: Int32Array) {
  const component = new Int32Array(faces.length / 3).fill(-1);
  const flip = new Uint8Array(component.length);
  const queue = new Int32Array(component.length);
  let components = 0;
  for (let seed = 0; seed < component.length; seed++) {
    if (component[seed] >= 0) continue;
    component[seed] = components;
    queue[0] = seed;
    for (let head = 0, tail = 1; head < tail; head++) {
      const f = queue[head];
      for (let h = 3 * f; h < 3 * f + 3; h++) {
        const t = twin[h];
        const g = faceOf(t);
        if (t < 0 || component[g] >= 0) continue;
        component[g] = components;
        flip[g] = flip[f] ^ Number(faces[h] === faces[t]);
        queue[tail++] = g;
      }
    }
    components++;
  }
  return { component, flip, components };
}

/** Which faces of consistently wound components look inward. winding: 1 where a face is wound as in
 * the file, -1 where it is not. */
function faceInward(
  vertices: Float64Array,
  faces: Int32Array,
  twin: Int32Array,
  component: Int32Array,
  count: number,
  winding: Int8Array,
): Uint8Array {
  const geometry = faceGeometry(vertices, faces);
  const middle = surfaceCentroid(geometry);
  const { cornerSums, crosses, doubles } = geometry;
  const areas = new Float64Array(count);
  const centres = new Float64Array(3 * count);
  const votes = new Int32Array(count);
  const isOpen = new Uint8Array(count);
  for (let f = 0; f < component.length; f++) {
    const [part, area] = [component[f], doubles[f] / 2];
    areas[part] += area;
    for (let k = 0; k < 3; k++) {
      centres[3 * part + k] += area * (cornerSums[3 * f + k] / 3);
      if (twin[3 * f + k] < 0) isOpen[part] = 1;
    }
    votes[part] += winding[f];
  }
  for (let i = 0; i < centres.length; i++) centres[i] /= areas[faceOf(i)];
  // Volumes that each component spans with its own centre and with the middle of the mesh.
  const own = new Float64Array(count);
  const common = new Float64Array(count);
  for (let f = 0; f < component.length; f++) {
    const part = component[f];
    let [height, heightCommon] = [0, 0];
    for (let k = 0; k < 3; k++) {
      const centroid = cornerSums[3 * f + k] / 3;
      height += (centroid - centres[3 * part + k]) * crosses[3 * f + k];
      heightCommon += (centroid - middle[k]) * crosses[3 * f + k];
    }
    own[part] += height / 2;
    common[part] += heightCommon / 2;
  }
  const inward = votes.map((vote, part) => {
    const [volume, outward, unit] = [own[part] / 3, common[part] / 3, areas[part] ** 1.5];
    if (Math.abs(volume) > (isOpen[part] ? OPEN_VOLUME : CLOSED_VOLUME) * unit) return Number(volume < 0);
    if (Math.abs(outward) > OPEN_VOLUME * unit) return Number(outward < 0);
    return Number(vote < 0);
  });
  return Uint8Array.from(component, (part) => inward[part]);
}

/** Reverse the winding of some faces in place: their first two sides swap. */
function turnFaces(faces: Int32Array, twin: Int32Array, which: Uint8Array): void {
  for (let f = 0; f < which.length; f++) {
    if (!which[f]) continue;
    const h = 3 * f;
    [faces[h], faces[h + 2]] = [faces[h + 2], faces[h]];
    [twin[h], twin[h + 1]] = [twin[h + 1], twin[h]];
  }
  for (let h = 0; h < twin.length; h++) {
    const t = twin[h];
    if (t >= 0 && which[faceOf(t)] && t % 3 < 2) twin[h] = t + 1 - 2 * (t % 3);
  }
}
