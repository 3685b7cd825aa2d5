// The worker as functions.

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

/** What the view draws of a file; rejects what cannot be shown. */
export const readForView = (file: Blob, name: string, coloured = false) =>
  ask(file, name, coloured) as Promise<Shown>;

/** The files in a ZIP archive, by their paths; rejects one that cannot be unpacked. */
export const unzip = (file: Blob) => ask(file, "zip", false) as Promise<Unpacked>;

async function ask(file: Blob, name: string, coloured: boolean): Promise<unknown> {
  const data = await file.arrayBuffer();
  const task: Task = { id: ++last, name, data, coloured };
  return new Promise((resolve, reject) => {
    waiting.set(task.id, { resolve, reject });
    worker.postMessage(task, [data]);
  });
}

export type { Shown, Unpacked };
