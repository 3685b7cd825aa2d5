// The files of a drop or a choice: which are meshes, and which are pieces of one (glTF buffers).

import { unzip, type Unpacked } from "./parsing";
import { extensionOf } from "./parsing/formats";

/** A file with its path below what was dropped, with slashes. */
export interface Found {
  file: File;
  path: string;
}

/** A mesh file and the files that it refers to, each named as it refers to it. */
export interface Parts {
  file: File;
  pieces: File[];
}

// Of one dropped folder; more is for the command line.
const MOST_FILES = 2000;

const folderOf = (path: string) => path.slice(0, path.lastIndexOf("/") + 1);

/** Files that were chosen in a dialog. */
export const chosen = (files: Iterable<File>): Found[] =>
  [...files].map((file) => ({ file, path: file.webkitRelativePath || file.name }));

/** The dropped files, and those of dropped folders. */
export async function dropped(data: DataTransfer): Promise<Found[]> {
  const files = chosen(data.files);
  // To be asked for before anything is awaited: the transfer is emptied then.
  const entries = [...data.items].map((item) => item.webkitGetAsEntry?.() ?? null);
  if (!entries.some((entry) => entry?.isDirectory)) return files;
  const found: Found[] = [];
  for (const entry of entries) if (entry) await walk(entry, found);
  return found;
}

async function walk(entry: FileSystemEntry, found: Found[]): Promise<void> {
  if (found.length >= MOST_FILES || entry.name.startsWith(".")) return;
  if (entry.isFile) {
    const file = await new Promise<File>((resolve, reject) =>
      (entry as FileSystemFileEntry).file(resolve, reject),
    );
    found.push({ file, path: entry.fullPath.replace(/^\//, "") });
    return;
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  // A call returns a hundred entries at the most.
  for (;;) {
    const some = await new Promise<FileSystemEntry[]>((resolve, reject) =>
      reader.readEntries(resolve, reject),
    );
    if (!some.length) return;
    for (const one of some) await walk(one, found);
  }
}

export interface Gathered {
  parts: Parts[];
  /** The names of files that are neither meshes nor pieces of one. */
  passedOver: string[];
}

/** Mesh files, of the extensions that the service reads, with their pieces. Other files are passed
 * over, unless nothing else is there: the service says what is wrong with them. */
export async function gathered(given: Found[], extensions: string[]): Promise<Gathered> {
  const isMesh = ({ file }: Found) => extensions.includes(extensionOf(file.name));
  const found = (await Promise.all(given.map((one) => unpacked(one, isMesh)))).flat();
  const meshes = found.filter(isMesh);
  const used = new Set(meshes.length ? meshes : found);
  const parts = [...used].map(async (one): Promise<Parts> => {
    const pieces = extensionOf(one.file.name) === "gltf" ? await piecesOf(one, found) : [];
    for (const piece of pieces) used.add(piece);
    const nameOf = ({ path }: Found) => path.slice(folderOf(one.path).length);
    return { file: one.file, pieces: pieces.map((piece) => new File([piece.file], nameOf(piece))) };
  });
  return {
    parts: await Promise.all(parts),
    passedOver: found.filter((one) => !used.has(one)).map(({ file }) => file.name),
  };
}

/** The files in a ZIP archive. One without meshes, or that cannot be unpacked, stays itself: the
 * service says what is wrong with it. */
async function unpacked(one: Found, isMesh: (file: Found) => boolean): Promise<Found[]> {
  if (extensionOf(one.file.name) !== "zip") return [one];
  const contents = await unzip(one.file).catch((): Unpacked => ({}));
  const files = Object.entries(contents).map(([path, content]) => ({
    file: new File([content], path.split("/").pop()!),
    path: `${one.path}/${path}`,
  }));
  return files.some(isMesh) ? files : [one];
}

async function piecesOf(mesh: Found, found: Found[]): Promise<Found[]> {
  const byPath = new Map(found.map((one) => [one.path, one]));
  const uris = await bufferUris(mesh.file);
  return uris.flatMap((uri) => byPath.get(folderOf(mesh.path) + uri) ?? []);
}

/** The relative paths of a .gltf file's buffers; none if it cannot be read. */
async function bufferUris(file: File): Promise<string[]> {
  try {
    const document = JSON.parse(await file.text()) as { buffers?: { uri?: string }[] };
    return (document.buffers ?? []).flatMap(({ uri }) =>
      uri && !/^[a-z]+:/i.test(uri) ? [decodeURIComponent(uri).replace(/^\.\//, "")] : [],
    );
  } catch {
    return [];
  }
}
