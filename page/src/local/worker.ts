// Classifies and explains beside the page. It makes no requests: what it needs is sent to it.

import type { Answer, Form } from "../api";
import { contentsOf } from "../parsing/pieces";
import { MeshError } from "../mesh";
import type { LocalModel } from "./build";
import { written } from "./explanation";
import { unpacked } from "./download";
import { type Pass, Pipeline, start } from "./pipeline";

/** A file, which comes first, with its pieces. key: the same for the same file. */
export interface Source {
  key: number;
  files: File[];
}

export type Task =
  | { does: "start"; runtime: ArrayBuffer }
  | { does: "open"; model: LocalModel; content: ArrayBuffer }
  | { does: "classify"; source: Source; model: string }
  | { does: "explain"; source: Source; model: string; label: string | null; form: Form };

export interface Classified {
  answer: Answer;
  embedding: Float32Array;
}

/** fault: that of a MeshError; null for an error of another kind. */
export type Reply = { result: unknown } | { fault: string | null; message: string };

const pipelines = new Map<string, Pipeline>();
// The last run, which is mostly the one that is explained.
let last: { key: string; pass: Pass } | null = null;

self.onmessage = async ({ data }: MessageEvent<Task>) => {
  self.postMessage(
    await work(data).then(
      (result): Reply => ({ result }),
      (error: unknown): Reply => ({
        fault: error instanceof MeshError ? error.fault : null,
        message: error instanceof Error ? error.message : String(error),
      }),
    ),
  );
};

async function work(task: Task): Promise<unknown> {
  switch (task.does) {
    case "start":
      return start(await unpacked(task.runtime));
    case "open":
      pipelines.set(task.model.name, await Pipeline.open(task.model, task.content));
      return null;
    case "classify": {
      const { answer, embedding } = await passOf(task.source, task.model);
      return { answer, embedding } satisfies Classified;
    }
    case "explain": {
      const pass = await passOf(task.source, task.model);
      const explanation = pipelines.get(task.model)!.explain(pass, task.label);
      return new Blob(written(explanation, task.form));
    }
  }
}

async function passOf({ key, files }: Source, model: string): Promise<Pass> {
  const name = `${key} ${model}`;
  if (last?.key !== name) {
    last = null; // its memory may be needed
    const [file, ...pieces] = files;
    const pass = await pipelines.get(model)!.run(file.name, await file.arrayBuffer(), await contentsOf(pieces));
    last = { key: name, pass };
  }
  return last.pass;
}
