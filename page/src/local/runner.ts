// The worker as a function: one task at a time, each within its time.

import { Refused, sentence, TITLES } from "../api";
import type { LocalModel } from "./build";
import type { Reply, Task } from "./worker";

// Most runs take a tenth of a second, those of a million faces some seconds.
const MOST_SECONDS = 60;

const REMEDY = "Simplify the mesh, or use the command line.";
const ENDED = `It was given up after ${MOST_SECONDS} seconds. ${REMEDY}`;
const BROKEN = `There was not enough memory for it, or this page has a fault. ${REMEDY}`;

/** What a model needs before its first task: WebAssembly of the runtime, packed, and its file. */
export interface Contents {
  runtime: ArrayBuffer;
  model: ArrayBuffer;
}

export class Runner {
  private worker: Worker | null = null;
  private readonly opened = new Set<string>();
  private turn: Promise<unknown> = Promise.resolve();

  /** The result of a task for a model. Rejects with a Refused; where that took too long, or broke
   * the worker, the next task has a new one. */
  ask(model: LocalModel, contents: Contents, task: Task, signal?: AbortSignal): Promise<unknown> {
    const mine = this.turn.then(async () => {
      signal?.throwIfAborted();
      if (!this.worker) {
        this.worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
        await this.send({ does: "start", runtime: contents.runtime });
      }
      if (!this.opened.has(model.name)) {
        await this.send({ does: "open", model, content: contents.model });
        this.opened.add(model.name);
      }
      const result = await this.send(task);
      signal?.throwIfAborted();
      return result;
    });
    this.turn = mine.catch(() => {});
    return mine;
  }

  private send(task: Task): Promise<unknown> {
    const worker = this.worker!;
    return new Promise((resolve, reject) => {
      const end = (title: string, message: string) => {
        clearTimeout(clock);
        worker.terminate();
        this.worker = null;
        this.opened.clear();
        reject(new Refused(title, message, true));
      };
      const clock = setTimeout(() => end(TITLES.slow, ENDED), 1000 * MOST_SECONDS);
      worker.onerror = () => end("This mesh is too much for this browser", BROKEN);
      worker.onmessage = ({ data }: MessageEvent<Reply>) => {
        clearTimeout(clock);
        if ("result" in data) resolve(data.result);
        else if (data.fault) reject(refusal(data.fault, data.message));
        else end("This browser failed on this mesh", `${data.message}. ${REMEDY}`);
      };
      worker.postMessage(task);
    });
  }
}

// Faults of files that hold no mesh; others are of files that cannot be read.
const UNUSABLE = [
  "extent-overflow",
  "index-out-of-range",
  "lost-in-simplification",
  "no-area",
  "no-faces",
  "no-mesh",
  "non-finite-vertices",
  "zero-extent",
];

/** The words of the service for a fault (`http`). */
function refusal(fault: string, message: string): Refused {
  const title = UNUSABLE.includes(fault)
    ? TITLES.unusable
    : fault.startsWith("too-many-")
      ? TITLES.large
      : ["unknown-format", "format-mismatch"].includes(fault)
        ? TITLES.format
        : TITLES.unreadable;
  return new Refused(title, sentence(message), false);
}
