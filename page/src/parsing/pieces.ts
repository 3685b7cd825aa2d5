// Files that a mesh file refers to, for its reader.

import type { Pieces } from "../loading/gltf";

/** The content of each file by its name. */
export const contentsOf = async (files: File[]): Promise<Pieces> =>
  new Map(
    await Promise.all(
      files.map(async (file) => [file.name, new Uint8Array(await file.arrayBuffer())] as const),
    ),
  );
