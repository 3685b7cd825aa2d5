// The files in a ZIP archive that is a mesh file itself (3MF, packed AMF).

import { type UnzipFileFilter, unzipSync } from "fflate";
import { MeshError } from "../mesh";
import { limit } from "./limits";
import { quoted } from "./text";

// How many times the archive's own size its files may unpack to, as `model.loading.limits` has it.
const MOST_PER_BYTE = 50;

export const isZip = (data: Uint8Array) => ["80,75,3,4", "80,75,5,6"].includes(data.subarray(0, 4).join());

/** The path of a part to which a reference in the part `source` leads: parts are named without case,
 * some with escapes, and never lead out of the package. */
export const partName = (reference: string, source = "") =>
  decodeURIComponent(new URL(reference, `http://package/${source}`).pathname)
    .slice(1)
    .toLowerCase();

/** The files of an archive by `partName`, those whose names end so. Throws MeshError for an archive that
 * is damaged, unpacks to too much, or names two files alike. */
export function unpack(data: Uint8Array, ends: RegExp): Map<string, Uint8Array> {
  const names = new Set<string>();
  let bytes = 0;
  const files = unzipped(data, ({ name, originalSize }) => {
    const part = partName(`/${name}`);
    if (!ends.test(part)) return false;
    if (names.has(part)) throw repeated(part);
    names.add(part);
    bytes += originalSize;
    const most = MOST_PER_BYTE * data.length;
    limit("unpacked bytes", bytes > most ? Infinity : bytes, `the package unpacks to ${bytes} bytes`);
    return true;
  });
  return new Map(Object.entries(files).map(([name, content]) => [partName(`/${name}`), content]));
}

/** The files of an archive that pass the filter, by their paths. Throws MeshError for an archive that is
 * damaged, and what the filter throws. */
export function unzipped(data: Uint8Array, filter: UnzipFileFilter): Record<string, Uint8Array<ArrayBuffer>> {
  try {
    return unzipSync(data, { filter }) as Record<string, Uint8Array<ArrayBuffer>>;
  } catch (error) {
    if (error instanceof MeshError) throw error;
    throw new MeshError(
      "truncated",
      "the package is no whole zip archive; it is cut off or damaged, export or upload it again",
    );
  }
}

/** The error of an archive that names two files alike. */
export const repeated = (name: string) =>
  new MeshError(
    "repeated-name",
    `the ZIP archive holds several files named ${quoted(name)}; pack it again, ` +
      "with a name of its own for each",
  );
