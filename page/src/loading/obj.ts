// Wavefront OBJ: the v and f lines, as `model.loading.obj` reads them. three.js's loader rounds to
// float32 and makes fans of concave polygons.

import { MeshError, type Mesh } from "../mesh";
import { limit } from "./limits";
import { textOf, Words } from "./text";
import { triangulate } from "./triangles";

// v and f lines that the next line continues; in other lines, a last backslash ends a path.
const CONTINUED = /^[ \t]*[vf][ \t][^\n#]*\\\n(?:[^\n#]*\\\n)*/gm;
const REFERENCE = /^([+-]?)(\d{1,18})(?:\/|$)/;

export function readObj(data: Uint8Array): Mesh {
  let text = textOf(data);
  if (text.includes("\\")) text = text.replace(CONTINUED, (lines) => lines.replaceAll("\\\n", " "));
  const words = new Words(text, 0, true);
  const vertices: number[] = [];
  const corners: number[] = [];
  const counts: number[] = [];
  for (; words.place < text.length; words.skipLine()) {
    const kind = words.nextInLine();
    if (kind === "v") vertices.push(...point(words));
    else if (kind === "f") {
      const first = corners.length;
      for (let word = words.nextInLine(); word; word = words.nextInLine()) {
        corners.push(reference(word, vertices.length / 3, words));
      }
      counts.push(corners.length - first);
    }
  }
  const count = vertices.length / 3;
  limit("vertices", count);
  const outside = corners.reduce((sum, corner) => sum + Number(corner < 0 || corner >= count), 0);
  if (outside) {
    throw new MeshError(
      "index-out-of-range",
      `${outside} of ${corners.length} face corners name a vertex that does not exist: indices ` +
        `begin at 1 and end at ${count}, or count back from the line of the face (-1, -2, ` +
        "...); the file is damaged or was written wrongly",
    );
  }
  return triangulate(Float64Array.from(vertices), corners, counts);
}

function point(words: Words): number[] {
  return [0, 1, 2].map(() => {
    const word = words.nextInLine();
    if (word) return words.number(word);
    throw new MeshError(
      "bad-vertex",
      `each v line must begin with three numbers x y z, unlike the line ${words.line}`,
    );
  });
}

/** The vertex that a word names, counted from 0; -1 for one that cannot exist. vertices: how many there
 * are before the face, from which negative numbers count back. */
function reference(word: string, vertices: number, words: Words): number {
  const found = REFERENCE.exec(word);
  if (!found) {
    throw new MeshError(
      "bad-face",
      `each f line must name its vertices by whole numbers, unlike the line ${words.line}`,
    );
  }
  const index = Number(found[2]);
  return Math.max(found[1] === "-" && index ? vertices - index : index - 1, -1);
}
