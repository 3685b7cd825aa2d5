// The backend in this browser: what the service answers over HTTP, without one.

import type { Alike, Answer, Backend, Form, Progress, Query, Sample } from "../api";
import { megabytes } from "../words";
import type { Build, Download, LocalModel } from "./build";
import { Downloads } from "./download";
import { nearest, type LibraryEntry } from "./library";
import { isKept, keep } from "./offline";
import { type Contents, Runner } from "./runner";
import type { Classified, Source, Task } from "./worker";

/** path: of the build's JSON. */
export async function open(path: string): Promise<Backend> {
  const kept = keep();
  const response = await fetch(path);
  return new Local((await response.json()) as Build, kept);
}

class Local implements Backend {
  readonly verb = "Loading";
  private readonly runner = new Runner();
  private readonly downloads = new Downloads();
  private readonly keys = new WeakMap<File, number>();
  private last = 0;

  constructor(
    private readonly build: Build,
    private readonly kept: Promise<void>,
  ) {}

  about(name: string): string {
    const here = "Runs in this browser; nothing is uploaded.";
    const model = this.model(name);
    const first = this.left([this.build.runtime, model]);
    const others = this.left(this.build.models.filter((one) => one !== model));
    const later = others ? `; a doubtful answer loads the other models, too (${megabytes(others)})` : "";
    if (first) return `${here} Your first file loads ${megabytes(first)}, once${later}.`;
    return isKept() ? `${here} It works without a network now.` : here;
  }

  models = async () => this.build.models;
  samples = async () => this.build.samples;
  formats = async () => this.build.formats;
  limits = async () => this.build.limits;
  library = async () => this.build.library;

  async sampleFile(sample: Sample): Promise<File> {
    const found = this.build.samples.find(({ name }) => name === sample.name)!;
    return new File([await this.downloads.get(found)], found.file);
  }

  async classify(files: File[], model: string, progress: Progress): Promise<Answer> {
    return (await this.classified(files, this.model(model), progress)).answer;
  }

  async explain(files: File[], query: Query, form: Form, signal?: AbortSignal): Promise<Blob> {
    const model = this.model(query.model);
    const source = this.source(files);
    const label = query.class ?? null;
    return (await this.ask(model, { does: "explain", source, model: model.name, label, form }, () => {}, signal)) as Blob;
  }

  async similar(files: File[]): Promise<Alike[]> {
    const { library } = this.build;
    if (!library) return [];
    const model = this.model(library.model);
    const [{ embedding }, embeddings, text] = await Promise.all([
      this.classified(files, model, () => {}),
      this.downloads.get(library.embeddings),
      this.downloads.get(library.entries),
    ]);
    const entries = JSON.parse(new TextDecoder().decode(text)) as LibraryEntry[];
    return nearest(embedding, new Float32Array(embeddings), entries, model.calibration);
  }

  private async classified(files: File[], model: LocalModel, progress: Progress): Promise<Classified> {
    const task: Task = { does: "classify", source: this.source(files), model: model.name };
    return (await this.ask(model, task, progress)) as Classified;
  }

  private async ask(model: LocalModel, task: Task, progress: Progress, signal?: AbortSignal) {
    const contents = await this.contents(model, progress);
    progress(1, 0);
    return this.runner.ask(model, contents, task, signal);
  }

  private async contents(model: LocalModel, progress: Progress): Promise<Contents> {
    await this.kept;
    const { runtime } = this.build;
    const bytes = this.left([runtime, model]);
    const before = this.received([runtime, model]);
    let waits = true; // after one failed, the other goes on
    const heard = () => {
      const received = this.received([runtime, model]) - before;
      if (waits && received < bytes) progress(received / bytes, bytes);
    };
    try {
      const [wasm, file] = await Promise.all([
        this.downloads.get(runtime, heard),
        this.downloads.get(model, heard),
      ]);
      return { runtime: wasm, model: file };
    } finally {
      waits = false;
    }
  }

  private received = (files: Download[]) =>
    files.reduce((sum, file) => sum + this.downloads.received(file), 0);

  /** Bytes that are still to be loaded. */
  private left = (files: Download[]) =>
    files.reduce((sum, file) => sum + file.bytes, 0) - this.received(files);

  /** By its name; the default without one. */
  private model(name?: string): LocalModel {
    return this.build.models.find((model) => model.name === name) ?? this.build.models[0];
  }

  private source(files: File[]): Source {
    const key = this.keys.get(files[0]) ?? ++this.last;
    this.keys.set(files[0], key);
    return { key, files };
  }
}
