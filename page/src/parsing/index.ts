// The worker as a function.

import type { Shown } from "./read";
import type { Task } from "./worker";

interface Reply {
  id: number;
  shown?: Shown;
  error?: string;
}

interface Waiting {
  resolve: (shown: Shown) => void;
  reject: (error: Error) => void;
}

const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
const waiting = new Map<number, Waiting>();
let last = 0;

worker.onmessage = ({ data }: MessageEvent<Reply>) => {
  const task = waiting.get(data.id);
  waiting.delete(data.id);
  if (data.shown) task?.resolve(data.shown);
  else task?.reject(new Error(data.error));
};

/** What the view draws of a file; rejects what cannot be shown. */
export async function readForView(file: Blob, name: string, coloured = false): Promise<Shown> {
  const data = await file.arrayBuffer();
  const task: Task = { id: ++last, name, data, coloured };
  return new Promise((resolve, reject) => {
    waiting.set(task.id, { resolve, reject });
    worker.postMessage(task, [data]);
  });
}

export type { Shown };
