// The files in a ZIP archive.

import { unzipSync } from "fflate";
import { extensionOf } from "./formats";

export type Unpacked = Record<string, Uint8Array<ArrayBuffer>>;

// Of all files together; more is for the command line.
const MOST_BYTES = 2 ** 30;

const isHidden = (part: string) => part.startsWith(".") || part === "__MACOSX";

/** The content of each file by its path, without hidden ones, folders, and archives within. Throws
 * for an archive that is damaged, too large, or names two files alike. */
export function unzip(data: ArrayBuffer): Unpacked {
  const names = new Set<string>();
  let bytes = 0;
  const files = unzipSync(new Uint8Array(data), {
    filter: ({ name, originalSize }) => {
      const left = name.split("/").some(isHidden) || name.endsWith("/");
      if (left || extensionOf(name) === "zip") return false;
      if (names.has(name)) throw new Error(`two files are named ${name}`);
      names.add(name);
      bytes += originalSize;
      if (bytes > MOST_BYTES) throw new Error("the archive unpacks to too much");
      return true;
    },
  });
  return files as Unpacked;
}
