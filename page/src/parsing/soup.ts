// Triangles with corners of their own, as the view draws them: three corners a face.

import type { ColouredMesh } from "../loading/gltf";

/** positions: 9 numbers a face. colours: 3 a face, linear light, or none. */
export interface Soup {
  positions: Float64Array;
  colours: Float32Array | null;
}

/** A face has the colour of its first corner. */
export function soupOf({ vertices, faces, colours }: ColouredMesh): Soup {
  const positions = new Float64Array(3 * faces.length);
  for (let h = 0; h < faces.length; h++) {
    for (let k = 0; k < 3; k++) positions[3 * h + k] = vertices[3 * faces[h] + k];
  }
  const perFace = colours && new Float32Array(faces.length);
  for (let i = 0; perFace && i < faces.length; i++) {
    perFace[i] = colours[3 * faces[i - (i % 3)] + (i % 3)];
  }
  return { positions, colours: perFace ?? null };
}
