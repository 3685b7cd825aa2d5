// Quadrics: sums of weighted squared distances to planes and points (Garland and Heckbert 1997), as
// `model.preparation.quadrics` has them. A quadric is ten numbers, p A p + 2 b p + c at the point p:
// xx, xy, xz, yy, yz, zz of the symmetric matrix A, then b, then c.

import type { Mesh } from "../mesh";
import { add, corners, cross, dot, length, row, scale, subtract, type Vector } from "./geometry";
import { nextSide } from "./halfedges";

// Weight of the plane that stands on a border edge, in units of its squared length, and of the
// vertices as they were, in units of the faces' area.
const BORDER_WEIGHT = 0.5;
const POINT_WEIGHT = 3e-4;

export const NUMBERS = 10;

/** Quadric of every vertex: of the planes of its faces, weighted by their areas. */
export function vertexQuadrics({ vertices, faces }: Mesh, twin: Int32Array): Float64Array {
  const quadrics = new Float64Array((vertices.length / 3) * NUMBERS);
  for (let f = 0; f < faces.length / 3; f++) {
    const [a, b, c] = corners(vertices, faces, f);
    const across = cross(subtract(b, a), subtract(c, a));
    const double = length(across);
    const normal = scale(across, 1 / double);
    const area = double / 2;
    for (let h = 3 * f; h < 3 * f + 3; h++) {
      const [u, v] = [faces[h], faces[nextSide(h)]];
      const start = row(vertices, u);
      addPlane(quadrics, u, normal, a, area);
      addPoint(quadrics, u, start, area * POINT_WEIGHT);
      if (twin[h] >= 0) continue;
      const edge = subtract(row(vertices, v), start);
      const square = dot(edge, edge);
      const outward = scale(cross(edge, normal), 1 / Math.sqrt(square));
      for (const end of [u, v]) addPlane(quadrics, end, outward, start, square * BORDER_WEIGHT);
    }
  }
  return quadrics;
}

function addPlane(quadrics: Float64Array, v: number, normal: Vector, point: Vector, weight: number): void {
  const offset = -dot(normal, point);
  const [x, y, z] = normal;
  const [weightedX, weightedY, weightedZ] = scale(normal, weight);
  const i = NUMBERS * v;
  quadrics[i] += weightedX * x;
  quadrics[i + 1] += weightedX * y;
  quadrics[i + 2] += weightedX * z;
  quadrics[i + 3] += weightedY * y;
  quadrics[i + 4] += weightedY * z;
  quadrics[i + 5] += weightedZ * z;
  quadrics[i + 6] += weightedX * offset;
  quadrics[i + 7] += weightedY * offset;
  quadrics[i + 8] += weightedZ * offset;
  quadrics[i + 9] += weight * offset * offset;
}

function addPoint(quadrics: Float64Array, v: number, point: Vector, weight: number): void {
  const i = NUMBERS * v;
  quadrics[i] += weight;
  quadrics[i + 3] += weight;
  quadrics[i + 5] += weight;
  quadrics[i + 6] -= weight * point[0];
  quadrics[i + 7] -= weight * point[1];
  quadrics[i + 8] -= weight * point[2];
  quadrics[i + 9] += weight * dot(point, point);
}

/** The point at which the sum of two vertices' quadrics is least, and that least value. start, end:
 * of the edge that is to become this point; its middle is taken where rounding leaves no single one. */
export function leastPoint(
  quadrics: Float64Array,
  u: number,
  v: number,
  start: Vector,
  end: Vector,
): [Vector, number] {
  const [i, j] = [NUMBERS * u, NUMBERS * v];
  const xx = quadrics[i] + quadrics[j];
  const xy = quadrics[i + 1] + quadrics[j + 1];
  const xz = quadrics[i + 2] + quadrics[j + 2];
  const yy = quadrics[i + 3] + quadrics[j + 3];
  const yz = quadrics[i + 4] + quadrics[j + 4];
  const zz = quadrics[i + 5] + quadrics[j + 5];
  const x = quadrics[i + 6] + quadrics[j + 6];
  const y = quadrics[i + 7] + quadrics[j + 7];
  const z = quadrics[i + 8] + quadrics[j + 8];
  const constant = quadrics[i + 9] + quadrics[j + 9];
  // Cofactors of A, which is positive definite but for rounding.
  const [a, b, c] = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
  const [d, e, f] = [xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy];
  const determinant = xx * a + xy * b + xz * c;
  if (determinant > 0) {
    const r = -1 / determinant;
    const point: Vector = [
      r * (a * x + b * y + c * z),
      r * (b * x + d * y + e * z),
      r * (c * x + e * y + f * z),
    ];
    return [point, Math.max(x * point[0] + y * point[1] + z * point[2] + constant, 0)];
  }
  const point = scale(add(start, end), 0.5);
  const image: Vector = [
    xx * point[0] + xy * point[1] + xz * point[2] + 2 * x,
    xy * point[0] + yy * point[1] + yz * point[2] + 2 * y,
    xz * point[0] + yz * point[1] + zz * point[2] + 2 * z,
  ];
  return [point, Math.max(dot(point, image) + constant, 0)];
}
