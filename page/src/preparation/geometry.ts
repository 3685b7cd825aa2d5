// Measures of triangles and operations on 3-vectors, as `model.topology.geometry` has them.

export type Vector = [x: number, y: number, z: number];

/** Of F triangles: three times the centroid (3 F), the cross product of two edges (3 F), whose
 * direction is the normal, and its length (F), twice the area. */
export interface FaceGeometry {
  cornerSums: Float64Array;
  crosses: Float64Array;
  doubles: Float64Array;
}

export function faceGeometry(vertices: Float64Array, faces: Int32Array): FaceGeometry {
  const cornerSums = new Float64Array(faces.length);
  const crosses = new Float64Array(faces.length);
  const doubles = new Float64Array(faces.length / 3);
  for (let f = 0; f < doubles.length; f++) {
    const [a, b, c] = corners(vertices, faces, f);
    const across = cross(subtract(b, a), subtract(c, a));
    write(cornerSums, f, add(add(a, b), c));
    write(crosses, f, across);
    doubles[f] = length(across);
  }
  return { cornerSums, crosses, doubles };
}

/** Area of each triangle. */
export function faceAreas(vertices: Float64Array, faces: Int32Array): Float64Array {
  const areas = new Float64Array(faces.length / 3);
  for (let f = 0; f < areas.length; f++) {
    const [a, b, c] = corners(vertices, faces, f);
    areas[f] = length(cross(subtract(b, a), subtract(c, a))) / 2;
  }
  return areas;
}

export const surfaceArea = (vertices: Float64Array, faces: Int32Array) => sum(faceAreas(vertices, faces));

/** Mean of the surface's points. */
export function surfaceCentroid({ cornerSums, doubles }: FaceGeometry): Vector {
  const moment: Vector = [0, 0, 0];
  for (let f = 0; f < doubles.length; f++) {
    for (let k = 0; k < 3; k++) moment[k] += (cornerSums[3 * f + k] / 3) * (doubles[f] / 2);
  }
  const area = sum(doubles) / 2;
  return [moment[0] / area, moment[1] / area, moment[2] / area];
}

/** Distance of the farthest vertex from a point. */
export function farthest(vertices: Float64Array, centre: Vector): number {
  let most = 0;
  for (let v = 0; v < vertices.length / 3; v++) {
    const step = subtract(row(vertices, v), centre);
    most = Math.max(most, dot(step, step));
  }
  return Math.sqrt(most);
}

/** Sum of numbers in the order in which NumPy adds them: pairwise, by eight lanes in runs of 128. */
export function sum(values: Float64Array): number {
  const n = values.length;
  if (n > 128) {
    const half = Math.floor(n / 2) - (Math.floor(n / 2) % 8);
    return sum(values.subarray(0, half)) + sum(values.subarray(half));
  }
  if (n < 8) return values.reduce((total, value) => total + value, 0);
  const lanes = values.slice(0, 8);
  let i = 8;
  for (; i < n - (n % 8); i += 8) for (let j = 0; j < 8; j++) lanes[j] += values[i + j];
  const [a, b, c, d, e, f, g, h] = lanes;
  let total = a + b + (c + d) + (e + f + (g + h));
  for (; i < n; i++) total += values[i];
  return total;
}

/** Row i of a table of 3 columns. */
export const row = (table: Float64Array, i: number): Vector => [
  table[3 * i],
  table[3 * i + 1],
  table[3 * i + 2],
];

/** The places of the corners of face f. */
export const corners = (vertices: Float64Array, faces: Int32Array, f: number): [Vector, Vector, Vector] => [
  row(vertices, faces[3 * f]),
  row(vertices, faces[3 * f + 1]),
  row(vertices, faces[3 * f + 2]),
];

export function write(table: Float64Array | Int32Array, i: number, a: Vector): void {
  table[3 * i] = a[0];
  table[3 * i + 1] = a[1];
  table[3 * i + 2] = a[2];
}

export const add = (a: Vector, b: Vector): Vector => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

export const subtract = (a: Vector, b: Vector): Vector => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

export const scale = (a: Vector, factor: number): Vector => [a[0] * factor, a[1] * factor, a[2] * factor];

export const dot = (a: Vector, b: Vector) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

export const cross = (a: Vector, b: Vector): Vector => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

export const length = (a: Vector) => Math.sqrt(dot(a, a));
