// Normals at corners, so that curved surfaces look curved and edges stay sharp.

import { firstEqual } from "./equal";

// Faces that meet at a larger angle meet at an edge.
const SMOOTH = Math.cos((35 * Math.PI) / 180);
// At a corner of more faces than these, each keeps its own normal.
const MOST_AROUND = 64;

/** positions and the result: 9 numbers a face. */
export function normalsOf(positions: Float32Array): Float32Array {
  const { unit, area } = faceNormals(positions);
  const { vertices, starts, corners } = around(positions);
  const normals = new Float32Array(positions.length);
  for (let c = 0; c < vertices.length; c++) {
    const own = c - (c % 3);
    let [x, y, z] = [0, 0, 0];
    const [start, end] = [starts[vertices[c]], starts[vertices[c] + 1]];
    for (let i = start; i < end && end - start <= MOST_AROUND; i++) {
      const f = corners[i] - (corners[i] % 3);
      const cosine = unit[own] * unit[f] + unit[own + 1] * unit[f + 1] + unit[own + 2] * unit[f + 2];
      if (cosine < SMOOTH) continue;
      x += area[f / 3] * unit[f];
      y += area[f / 3] * unit[f + 1];
      z += area[f / 3] * unit[f + 2];
    }
    const length = Math.hypot(x, y, z);
    normals[3 * c] = length ? x / length : unit[own];
    normals[3 * c + 1] = length ? y / length : unit[own + 1];
    normals[3 * c + 2] = length ? z / length : unit[own + 2];
  }
  return normals;
}

function faceNormals(p: Float32Array): { unit: Float32Array; area: Float32Array } {
  const unit = new Float32Array(p.length / 3);
  const area = new Float32Array(p.length / 9);
  for (let f = 0; f < area.length; f++) {
    const i = 9 * f;
    const [ux, uy, uz] = [p[i + 3] - p[i], p[i + 4] - p[i + 1], p[i + 5] - p[i + 2]];
    const [vx, vy, vz] = [p[i + 6] - p[i], p[i + 7] - p[i + 1], p[i + 8] - p[i + 2]];
    const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const size = Math.hypot(x, y, z);
    if (!size) continue;
    area[f] = size;
    unit[3 * f] = x / size;
    unit[3 * f + 1] = y / size;
    unit[3 * f + 2] = z / size;
  }
  return { unit, area };
}

/** vertices: of each corner. Those of vertex v are corners[starts[v]] to corners[starts[v + 1] - 1]. */
function around(positions: Float32Array) {
  const bits = new Int32Array(positions.buffer, positions.byteOffset, positions.length);
  const vertices = firstEqual(bits, 3);
  const starts = new Int32Array(vertices.length + 1);
  for (const v of vertices) starts[v + 1]++;
  for (let v = 0; v < vertices.length; v++) starts[v + 1] += starts[v];
  const filled = starts.slice();
  const corners = new Int32Array(vertices.length);
  for (let c = 0; c < vertices.length; c++) corners[filled[vertices[c]]++] = c;
  return { vertices, starts, corners };
}
