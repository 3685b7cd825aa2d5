// Preparing a mesh for a whole pipeline: weld, turn outward, simplify or subdivide, normalise.
import { MeshoptSimplifier } from "meshoptimizer";

const GRID = 2 ** 20; // steps along the longest side, as the package has

/** vertices: 3 V numbers, any unit. faces: 3 F. Gives both for a mesh of about `budget` faces. */
export async function prepare(vertices, faces, budget = 500) {
  await MeshoptSimplifier.ready;
  const { vertices: points, faces: all } = turnOutward(weld(vertices, faces));
  // A part smaller than the error may be left out: with a great error at once, all of them.
  let few = all;
  for (let error = 1 / 64; few.length > 3 * budget && error <= 1; error *= 2) {
    const [left] = MeshoptSimplifier.simplify(few, points, 3, 3 * budget, error, ["Prune"]);
    if (left.length === 0) break;
    few = left;
  }
  return normalise(subdivide({ vertices: points, faces: few }, budget));
}

/** In a box of side 1; vertices that are one step of a grid apart become one. Faces that lose a
 * corner by that, and those that are there already, are left out. */
function weld(vertices, faces) {
  let low = [Infinity, Infinity, Infinity];
  let high = low.map((x) => -x);
  for (const i of faces) {
    const point = vertices.subarray(3 * i, 3 * i + 3);
    low = low.map((x, k) => Math.min(x, point[k]));
    high = high.map((x, k) => Math.max(x, point[k]));
  }
  const side = Math.max(...high.map((x, k) => x - low[k]));
  const numbers = new Map();
  const welded = [];
  const corner = (i) => {
    const point = low.map((x, k) => Math.round(((vertices[3 * i + k] - x) / side) * GRID));
    const key = point.join();
    if (!numbers.has(key)) {
      numbers.set(key, numbers.size);
      welded.push(...point.map((x) => x / GRID));
    }
    return numbers.get(key);
  };
  const kept = new Map();
  for (let f = 0; f < faces.length; f += 3) {
    const face = [corner(faces[f]), corner(faces[f + 1]), corner(faces[f + 2])];
    if (new Set(face).size === 3) kept.set([...face].sort((a, b) => a - b).join(), face);
  }
  return { vertices: Float32Array.from(welded), faces: Uint32Array.from([...kept.values()].flat()) };
}

/** Each part in one orientation, such that it encloses a positive volume. */
function turnOutward({ vertices, faces }) {
  const edge = (h) => {
    const [a, b] = [faces[h], faces[next(h)]];
    return Math.min(a, b) * vertices.length + Math.max(a, b);
  };
  const over = new Map(); // the half-edges over each edge
  for (let h = 0; h < faces.length; h++) {
    if (!over.get(edge(h))?.push(h)) over.set(edge(h), [h]);
  }
  const turned = new Int8Array(faces.length / 3); // 0: not seen, 1: as it is, -1: to turn
  const point = (i) => vertices.subarray(3 * i, 3 * i + 3);
  for (let first = 0; first < turned.length; first++) {
    if (turned[first]) continue;
    turned[first] = 1;
    const part = [first];
    for (const f of part) {
      for (const h of [3 * f, 3 * f + 1, 3 * f + 2]) {
        const both = over.get(edge(h));
        for (const other of both.length === 2 ? both : []) {
          const g = Math.floor(other / 3);
          if (turned[g]) continue;
          turned[g] = faces[other] === faces[h] ? -turned[f] : turned[f];
          part.push(g);
        }
      }
    }
    const middle = point(faces[3 * first]);
    const volume = part.reduce((sum, f) => {
      const [a, b, c] = [0, 1, 2].map((s) => minus(point(faces[3 * f + s]), middle));
      return sum + turned[f] * dot(a, cross(b, c));
    }, 0);
    if (volume < 0) for (const f of part) turned[f] = -turned[f];
  }
  const result = faces.slice();
  turned.forEach((sign, f) => {
    if (sign < 0) [result[3 * f], result[3 * f + 1]] = [faces[3 * f + 1], faces[3 * f]];
  });
  return { vertices, faces: result };
}

/** Halve the longest edge until there are `budget` faces. */
function subdivide({ vertices, faces }, budget) {
  const points = Array.from({ length: vertices.length / 3 }, (_, i) =>
    Array.from(vertices.subarray(3 * i, 3 * i + 3)),
  );
  const list = Array.from({ length: faces.length / 3 }, (_, f) =>
    Array.from(faces.subarray(3 * f, 3 * f + 3)),
  );
  while (list.length < budget) {
    let longest = [-1];
    for (const face of list) {
      face.forEach((a, s) => {
        const step = minus(points[a], points[face[(s + 1) % 3]]);
        if (dot(step, step) > longest[0]) longest = [dot(step, step), a, face[(s + 1) % 3]];
      });
    }
    const [, a, b] = longest;
    const middle = points.push(points[a].map((x, k) => (x + points[b][k]) / 2)) - 1;
    for (const face of list.filter((face) => face.includes(a) && face.includes(b))) {
      list.push(face.map((v) => (v === a ? middle : v)));
      face.splice(face.indexOf(b), 1, middle);
    }
  }
  return { vertices: Float32Array.from(points.flat()), faces: Uint32Array.from(list.flat()) };
}

/** The centroid of the surface at the origin, the farthest vertex on the unit sphere. */
function normalise({ vertices, faces }) {
  const point = (i) => vertices.subarray(3 * i, 3 * i + 3);
  let centre = [0, 0, 0];
  let total = 0;
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [0, 1, 2].map((s) => point(faces[f + s]));
    const area = Math.hypot(...cross(minus(b, a), minus(c, a)));
    centre = centre.map((x, k) => x + (area * (a[k] + b[k] + c[k])) / 3);
    total += area;
  }
  centre = centre.map((x) => x / total);
  let radius = 0;
  for (const i of faces) radius = Math.max(radius, Math.hypot(...minus(point(i), centre)));
  return { vertices: vertices.map((x, i) => (x - centre[i % 3]) / radius), faces };
}

const next = (h) => (h % 3 === 2 ? h - 2 : h + 1);
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
