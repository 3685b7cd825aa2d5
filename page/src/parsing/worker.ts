// Reads and unpacks files beside the page, which goes on turning.

import type { Pieces } from "../loading/gltf";
import { read } from "./read";
import { unzip } from "./unzip";

/** A file to read for the view, with its pieces; as name, "zip" for one to unpack. */
export interface Task {
  id: number;
  name: string;
  data: ArrayBuffer;
  pieces: Pieces;
  coloured: boolean;
}

self.onmessage = async ({ data: task }: MessageEvent<Task>) => {
  const { id, name, data } = task;
  try {
    if (name === "zip") {
      const result = unzip(data);
      self.postMessage({ id, result }, { transfer: Object.values(result).map(({ buffer }) => buffer) });
      return;
    }
    const result = await read(name, data, task.pieces, task.coloured);
    const arrays = [result.positions, result.normals, result.colours];
    self.postMessage({ id, result }, { transfer: arrays.flatMap((array) => array?.buffer ?? []) });
  } catch (error) {
    self.postMessage({ id, error: String(error) });
  }
};
