// The files in a ZIP archive.

import { repeated, unzipped } from "../loading/archive";
import { MeshError } from "../mesh";
import { extensionOf } from "./formats";

export type Unpacked = Record<string, Uint8Array<ArrayBuffer>>;

// Of all files together; more is for the command line.
const MOST_BYTES = 2 ** 30;

const isHidden = (part: string) => part.startsWith(".") || part === "__MACOSX";

/** The content of each file by its path, without hidden ones, folders, and archives within. Throws
 * MeshError for an archive that is damaged, too large, or names two files alike. */
export function unzip(data: ArrayBuffer): Unpacked {
  const names = new Set<string>();
  let bytes = 0;
  return unzipped(new Uint8Array(data), ({ name, originalSize }) => {
    const left = name.split("/").some(isHidden) || name.endsWith("/");
    if (left || extensionOf(name) === "zip") return false;
    if (names.has(name)) throw repeated(name);
    names.add(name);
    bytes += originalSize;
    if (bytes > MOST_BYTES) {
      throw new MeshError(
        "too-many-unpacked-bytes",
        `the ZIP archive unpacks to more than the limit of ${MOST_BYTES} bytes; pack fewer meshes in it`,
      );
    }
    return true;
  });
}
