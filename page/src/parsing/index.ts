// The worker as functions.

import type { Pieces } from "../loading/gltf";
import { contentsOf } from "./pieces";
import type { Shown } from "./read";
import type { Unpacked } from "./unzip";
import type { Task } from "./worker";

interface Reply {
  id: number;
  result?: unknown;
  error?: string;
}

interface Waiting {
  resolve: (result: unknown) => void;
  reject: (error: Error) => void;
}

const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
const waiting = new Map<number, Waiting>();
let last = 0;

worker.onmessage = ({ data }: MessageEvent<Reply>) => {
  const task = waiting.get(data.id);
  waiting.delete(data.id);
  if (data.error === undefined) task?.resolve(data.result);
  else task?.reject(new Error(data.error));
};

/** What the view draws of a file, with the pieces that it refers to; rejects what cannot be shown. */
export const readForView = async (file: Blob, name: string, pieces: File[] = [], coloured = false) =>
  (await ask(file, name, await contentsOf(pieces), coloured)) as Shown;

/** The files in a ZIP archive, by their paths; rejects one that cannot be unpacked. */
export const unzip = (file: Blob) => ask(file, "zip", new Map(), false) as Promise<Unpacked>;

async function ask(file: Blob, name: string, pieces: Pieces, coloured: boolean): Promise<unknown> {
  const data = await file.arrayBuffer();
  const task: Task = { id: ++last, name, data, pieces, coloured };
  return new Promise((resolve, reject) => {
    waiting.set(task.id, { resolve, reject });
    worker.postMessage(task, [data]);
  });
}

export type { Shown, Unpacked };
