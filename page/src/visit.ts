// The files of a visit on their way: read for the view, classified, explained. Knows no elements.

import * as api from "./api";
import { Entry, type Explained, type Legend } from "./entries";
import type { Parts } from "./files";
import { readForView, type Shown } from "./parsing";
import { isZUp } from "./parsing/formats";
import { thumbnail } from "./thumbnails";
import { megabytes, plain, verdict } from "./words";

// Requests that are under way together.
const AT_ONCE = 2;

export type Form = "glb" | "ply" | "json";

const MEDIA_TYPES: Record<Form, string> = {
  glb: "model/gltf-binary",
  ply: "model/ply",
  json: "application/json",
};

export class Visit {
  readonly entries: Entry[] = [];
  current: Entry | null = null;
  models: api.Model[] = [];
  library: api.Library | null = null;
  mostBytes = Infinity;
  private readonly queue: Entry[] = [];
  private running = 0;

  /** changed: something is to be shown anew; say: something is to be heard. */
  constructor(
    private readonly changed: () => void,
    private readonly say: (words: string) => void,
  ) {}

  add(parts: Parts[], model: string): void {
    const added = parts.map(({ file, pieces }) => new Entry(file, pieces, isZUp(file.name), model));
    this.entries.push(...added);
    for (const entry of added) {
      void this.draw(entry);
      this.ask(entry, model);
    }
    if (added.length) this.select(added[0]);
  }

  select(entry: Entry): void {
    this.current = entry;
    this.changed();
  }

  turnUpright(entry: Entry): void {
    entry.zUp = !entry.zUp;
    if (entry.shown) entry.picture = thumbnail(entry.shown, entry.zUp);
    this.changed();
  }

  /** Classify an entry, anew if it was. */
  ask(entry: Entry, model: string): void {
    entry.forget(model);
    if (entry.file.size > this.mostBytes) {
      const words =
        `It has ${megabytes(entry.file.size)}; the service takes ${megabytes(this.mostBytes)}. ` +
        "Simplify the mesh, or use a binary format (STL, PLY, GLB).";
      this.fail(entry, new api.Refused("This file is too large", words, false));
      return;
    }
    if (!this.queue.includes(entry)) this.queue.push(entry);
    this.next();
  }

  /** Whether the model of an entry can show its evidence. */
  explains(entry: Entry): boolean {
    const model = this.models.find(({ name }) => name === entry.model);
    return model?.config.pooling !== "learned";
  }

  /** Show the evidence for a class, or the bare mesh if it is shown already. */
  async choose(entry: Entry, label: string): Promise<void> {
    entry.explainError = null;
    if (entry.chosen === label) {
      entry.chosen = entry.wanted = null;
      this.changed();
      return;
    }
    entry.wanted = label;
    this.changed();
    const explained = await this.attempt(entry, () => this.explained(entry, label));
    if (entry.wanted !== label) return; // another was chosen meanwhile
    if (explained) {
      entry.chosen = label;
      this.say(`The surface shows the evidence for ${plain(label)}`);
    } else {
      entry.wanted = entry.chosen;
    }
    this.changed();
  }

  /** Look for meshes of the library that are like an entry. */
  async search(entry: Entry): Promise<void> {
    entry.searching = true;
    this.changed();
    entry.similar = await this.attempt(entry, () => api.similar([entry.file, ...entry.pieces]));
    entry.searching = false;
    if (entry.similar) this.say(`${entry.similar.length} meshes of the library are shown`);
    this.changed();
  }

  /** What an entry is downloaded as, for the class on its surface or the likeliest. */
  async download(entry: Entry, form: Form): Promise<File | null> {
    const answer = entry.answer!;
    const label = entry.chosen ?? answer.class;
    const blob = await this.attempt(entry, async () => {
      if (!this.explains(entry)) return new Blob([JSON.stringify(answer, null, 2)]);
      if (form === "glb") return (await this.explained(entry, label)).glb;
      return api.explain([entry.file, ...entry.pieces], { model: entry.model, class: label }, MEDIA_TYPES[form]);
    });
    return blob && new File([blob], `${entry.file.name}-${label}.${form}`);
  }

  private async draw(entry: Entry): Promise<void> {
    try {
      this.drawn(entry, await readForView(entry.file, entry.file.name));
    } catch {
      entry.unreadable = true;
      if (entry.answer) await this.drawAsServed(entry);
    }
    this.changed();
  }

  /** Draw what the page cannot read from the mesh that the service returns. */
  private async drawAsServed(entry: Entry): Promise<void> {
    if (!this.explains(entry)) return;
    const label = entry.answer!.class;
    const explained = await this.attempt(entry, () => this.explained(entry, label));
    if (explained) this.drawn(entry, await readForView(explained.glb, "a.glb"));
    this.changed();
  }

  /** A file that the page cannot read, as the service returns it; null where it is refused. */
  async servedMesh(file: File): Promise<Shown | null> {
    try {
      return await readForView(await api.explain([file], {}, MEDIA_TYPES.glb), "a.glb");
    } catch {
      return null;
    }
  }

  private drawn(entry: Entry, shown: Shown): void {
    entry.shown = shown;
    entry.unreadable = false;
    entry.picture = thumbnail(shown, entry.zUp);
  }

  private next(): void {
    while (this.running < AT_ONCE && this.queue.length) {
      this.running++;
      void this.classify(this.queue.shift()!).finally(() => {
        this.running--;
        this.next();
      });
    }
  }

  private async classify(entry: Entry): Promise<void> {
    const { model } = entry;
    try {
      const answer = await api.classify([entry.file, ...entry.pieces], model, (share) => {
        entry.state = share < 1 ? { step: "sending", share } : { step: "waiting" };
        this.changed();
      });
      if (entry.model !== model) return; // another was chosen meanwhile
      entry.state = { step: "done", answer };
      this.say(`${entry.file.name}: ${verdict(answer)}`);
      this.changed();
      if (entry.unreadable) await this.drawAsServed(entry);
    } catch (error) {
      this.fail(entry, api.asRefused(error));
    }
  }

  private fail(entry: Entry, error: api.Refused): void {
    entry.state = { step: "failed", error };
    this.say(`${entry.file.name}: ${error.title}. ${error.message}`);
    this.changed();
  }

  /** The result of work for an explanation, or null when the entry says why there is none. */
  private async attempt<Value>(entry: Entry, work: () => Promise<Value>): Promise<Value | null> {
    try {
      return await work();
    } catch (error) {
      entry.explainError = api.asRefused(error);
      this.say(entry.explainError.message);
      this.changed();
      return null;
    }
  }

  private async explained(entry: Entry, label: string): Promise<Explained> {
    const known = entry.explained.get(label);
    if (known) return known;
    const { model } = entry;
    const glb = await api.explain([entry.file, ...entry.pieces], { model, class: label }, MEDIA_TYPES.glb);
    const [legend, shown] = await Promise.all([legendOf(glb), readForView(glb, "a.glb", true)]);
    const explained = { glb, legend, shown };
    if (entry.model === model) entry.explained.set(label, explained);
    return explained;
  }
}

/** The legend that the service wrote into a GLB. */
async function legendOf(glb: Blob): Promise<Legend> {
  const length = new DataView(await glb.slice(12, 16).arrayBuffer()).getUint32(0, true);
  const text = await glb.slice(20, 20 + length).text();
  return (JSON.parse(text) as { nodes: { extras: Legend }[] }).nodes[0].extras;
}
