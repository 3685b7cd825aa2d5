// A mesh and its checks, with the words of the service (`model.mesh`, `model.errors`).

/** vertices: 3 V numbers. faces: 3 F, each below V. note: parts that reading left out or guessed. */
export interface Mesh {
  vertices: Float64Array;
  faces: Int32Array;
  note?: string;
}

/** Error of one mesh, or of its file. fault: short stable code, as "non-finite-vertices". */
export class MeshError extends Error {
  constructor(
    readonly fault: string,
    message: string,
  ) {
    super(message);
  }
}

/** Throws MeshError for vertices and faces that are no mesh. */
export function check({ vertices, faces }: Mesh): void {
  const count = vertices.length / 3;
  if (faces.length === 0) {
    throw new MeshError(
      "no-faces",
      `there are no triangles (${count} points): ` +
        "point clouds, curves and empty scenes cannot be classified; export a surface mesh",
    );
  }
  const outside = faces.reduce((sum, v) => sum + Number(v < 0 || v >= count), 0);
  if (outside) {
    throw new MeshError(
      "index-out-of-range",
      `${outside} of ${faces.length} face corners name a vertex that does not exist ` +
        `(valid: 0 to ${count - 1}); correct the faces, or export the mesh again`,
    );
  }
  const { used, bad, low, high } = measure(vertices, faces);
  if (bad) {
    throw new MeshError(
      "non-finite-vertices",
      `${bad} of ${used} vertices are NaN or infinite; repair or export the mesh again`,
    );
  }
  const extent = high.map((value, k) => value - low[k]);
  if (!extent.every(Number.isFinite)) {
    const [least, most] = [Math.min(...low), Math.max(...high)].map(brief);
    throw new MeshError(
      "extent-overflow",
      `the mesh spans ${least} to ${most}, ` + "more than a floating-point number can measure; scale it down",
    );
  }
  if (extent.every((side) => side === 0)) {
    throw new MeshError(
      "zero-extent",
      `all ${used} vertices lie in one point; export the mesh ` +
        "again, in units in which it does not vanish",
    );
  }
}

/** Three digits of a number, as Python's format .3g. */
const brief = (value: number) => Number(value.toPrecision(3)).toString();

/** How many vertices faces use, how many of these are not finite, and the extent of the others. */
function measure(vertices: Float64Array, faces: Int32Array) {
  const named = new Uint8Array(vertices.length / 3);
  for (const v of faces) named[v] = 1;
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  let used = 0;
  let bad = 0;
  for (let v = 0; v < named.length; v++) {
    if (!named[v]) continue;
    used++;
    const i = 3 * v;
    if (![vertices[i], vertices[i + 1], vertices[i + 2]].every(Number.isFinite)) {
      bad++;
      continue;
    }
    for (let k = 0; k < 3; k++) {
      low[k] = Math.min(low[k], vertices[i + k]);
      high[k] = Math.max(high[k], vertices[i + k]);
    }
  }
  return { used, bad, low, high };
}
