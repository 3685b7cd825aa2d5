// How much of a file is read before it is refused, as `model.loading.limits` says.

import { MeshError } from "../mesh";

export const LIMITS = {
  vertices: 10_000_000,
  faces: 10_000_000,
  geometries: 10_000, // placed parts of a scene
  "repeated faces": 1_000_000, // of parts where they are placed once more
  "ear steps": 1e9, // comparisons by which concave polygons are cut
  values: 2_000_000, // in the JSON of a glTF file; elements and attributes of XML
  "unpacked bytes": 2 ** 29,
};

/** Throws where there are more. found: what was found, as the beginning of a sentence. */
export function limit(
  what: keyof typeof LIMITS,
  count: number,
  found = `the file has ${count} ${what}`,
): void {
  if (count <= LIMITS[what]) return;
  throw new MeshError(
    `too-many-${what.replaceAll(" ", "-")}`,
    `${found}, more than the limit of ${LIMITS[what]}; simplify the mesh or split it up`,
  );
}
