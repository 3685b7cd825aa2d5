// Scenes: parts that are placed, each maybe many times, to one list of triangles, as
// `model.loading.scene` joins them.

import { Matrix4, Vector3 } from "three";
import type { Mesh } from "../mesh";
import { limit } from "./limits";

export interface Placed {
  part: Mesh;
  matrix: Matrix4;
}

/** All parts where their matrices place them. */
export function flatten(placed: Placed[]): Mesh {
  limit("geometries", placed.length);
  const sizeOf = (array: "vertices" | "faces") =>
    placed.reduce((sum, { part }) => sum + part[array].length / 3, 0);
  limit("vertices", sizeOf("vertices"));
  limit("faces", sizeOf("faces"));
  const own = [...new Set(placed.map(({ part }) => part))].reduce(
    (sum, { faces }) => sum + faces.length / 3,
    0,
  );
  limit("repeated faces", sizeOf("faces") - own);
  const vertices = new Float64Array(3 * sizeOf("vertices"));
  const faces = new Int32Array(3 * sizeOf("faces"));
  const point = new Vector3();
  let [offset, place] = [0, 0];
  for (const { part, matrix } of placed) {
    const count = part.vertices.length / 3;
    for (let v = 0; v < count; v++) {
      point
        .fromArray(part.vertices, 3 * v)
        .applyMatrix4(matrix)
        .toArray(vertices, 3 * (offset + v));
    }
    // A mirror turns triangles inside out.
    const isMirrored = matrix.determinant() < 0;
    for (let h = 0; h < part.faces.length; h++) {
      const corner = part.faces[isMirrored ? h + 2 - 2 * (h % 3) : h];
      // A bad index must stay bad, not name a vertex of another part.
      faces[place++] = corner >= 0 && corner < count ? corner + offset : -1;
    }
    offset += count;
  }
  return { vertices, faces };
}
