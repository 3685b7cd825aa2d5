// Triangles with corners of their own, as the view draws them: three corners a face.

import { BufferAttribute, Matrix4, Mesh, Vector3 } from "three";
import type { BufferGeometry, InterleavedBufferAttribute, Object3D } from "three";

/** positions: 9 numbers a face. colours: 3 a face, linear light, or none. */
export interface Soup {
  positions: Float64Array;
  colours: Float32Array | null;
}

interface Part {
  geometry: BufferGeometry;
  matrix: Matrix4;
}

/** All triangles below an object, where it places them. */
export function soupOf(root: Object3D): Soup {
  const parts: Part[] = [];
  root.updateMatrixWorld(true);
  root.traverse((object) => {
    if (object instanceof Mesh) parts.push({ geometry: object.geometry, matrix: object.matrixWorld });
  });
  return joined(parts);
}

export const soupOfGeometry = (geometry: BufferGeometry) =>
  joined([{ geometry, matrix: new Matrix4() }]);

type Attribute = BufferAttribute | InterleavedBufferAttribute;

function joined(parts: Part[]): Soup {
  const faces = parts.map(({ geometry }) =>
    Math.floor((geometry.index ?? geometry.getAttribute("position")).count / 3),
  );
  const total = faces.reduce((sum, count) => sum + count, 0);
  const positions = new Float64Array(9 * total);
  const coloured = total > 0 && parts.every(({ geometry }) => geometry.hasAttribute("color"));
  const colours = coloured ? new Float32Array(3 * total) : null;
  const corner = new Vector3();
  let face = 0;
  parts.forEach(({ geometry, matrix }, i) => {
    const position = geometry.getAttribute("position") as Attribute;
    const colour = coloured ? (geometry.getAttribute("color") as Attribute) : null;
    for (let f = 0; f < faces[i]; f++, face++) {
      for (let s = 0; s < 3; s++) {
        const vertex = geometry.index ? geometry.index.getX(3 * f + s) : 3 * f + s;
        corner.fromBufferAttribute(position as BufferAttribute, vertex).applyMatrix4(matrix);
        corner.toArray(positions, 9 * face + 3 * s);
        if (colour && colours && s === 0) {
          colours[3 * face] = colour.getX(vertex);
          colours[3 * face + 1] = colour.getY(vertex);
          colours[3 * face + 2] = colour.getZ(vertex);
        }
      }
    }
  });
  return { positions, colours };
}
