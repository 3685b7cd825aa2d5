// The files of a visit on their way: read for the view, classified, explained. Knows no elements.

import * as api from "./api";
import { backend } from "./backend";
import { Entry, type Explained, type Legend } from "./entries";
import type { Parts } from "./files";
import { readForView, type Shown } from "./parsing";
import { thumbnail } from "./thumbnails";
import { isZUp } from "./upright";
import { isRough, isWeak, megabytes, plain, verdict } from "./words";

// Requests that are under way together.
const AT_ONCE = 2;

export class Visit {
  readonly entries: Entry[] = [];
  current: Entry | null = null;
  models: api.Model[] = [];
  library: api.Library | null = null;
  mostBytes = Infinity;
  /** Whether evidence is shown. */
  evidence = true;
  private queue: Entry[] = [];
  private running = 0;

  /** changed: something is to be shown anew; say: something is to be heard. */
  constructor(
    private readonly changed: () => void,
    private readonly say: (words: string) => void,
  ) {}

  add(parts: Parts[], model: string): void {
    const added = parts.map(({ file, pieces }) => new Entry(file, pieces, model));
    this.entries.push(...added);
    for (const entry of added) {
      void this.draw(entry);
      this.ask(entry, model);
    }
    if (added.length) this.select(added[0]);
  }

  select(entry: Entry | null): void {
    this.current = entry;
    this.changed();
    if (entry) void this.look(entry);
  }

  remove(entries: Entry[]): void {
    this.say("");
    const place = this.entries.indexOf(this.current!);
    for (const entry of entries) {
      entry.explaining?.abort();
      this.entries.splice(this.entries.indexOf(entry), 1);
    }
    this.queue = this.queue.filter((entry) => this.entries.includes(entry));
    if (this.entries.includes(this.current!)) this.changed();
    else this.select(this.entries[Math.min(place, this.entries.length - 1)] ?? null);
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
        `It has ${megabytes(entry.file.size)}; the most that is read is ${megabytes(this.mostBytes)}. ` +
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

  /** Show the evidence for a class. */
  choose(entry: Entry, label: string): void {
    entry.chosen = label;
    this.showEvidence(entry, true);
  }

  /** Show evidence on this mesh and those that are looked at later, or the bare meshes. */
  showEvidence(entry: Entry, on: boolean): void {
    this.evidence = on;
    entry.explaining?.abort();
    this.changed();
    void this.explain(entry);
  }

  /** Take the answer of a model that is surer. */
  take(entry: Entry, answer: api.Answer): void {
    entry.forget(answer.model.name);
    void this.answered(entry, answer);
  }

  /** Look for meshes of the library that are like an entry. */
  async search(entry: Entry): Promise<void> {
    entry.searching = true;
    entry.searchError = null;
    this.changed();
    let words: string;
    try {
      entry.similar = await backend.similar(entry.files);
      words = `${entry.similar.length} meshes of the library are shown`;
    } catch (error) {
      entry.searchError = api.asRefused(error);
      words = entry.searchError.message;
    }
    entry.searching = false;
    if (entry === this.current) this.say(words);
    this.changed();
  }

  /** What an entry is downloaded as, for the class on its surface or the likeliest. */
  async download(entry: Entry, form: api.Form): Promise<File | null> {
    const { label, model } = entry;
    const blob = await this.attempt(entry, async () => {
      if (!this.explains(entry)) return new Blob([JSON.stringify(entry.answer, null, 2)]);
      if (form === "glb") return (await this.explained(entry, label)).glb;
      return backend.explain(entry.files, { model, class: label }, form);
    });
    return blob && new File([blob], `${entry.file.name}-${label}.${form}`);
  }

  private async draw(entry: Entry): Promise<void> {
    try {
      this.drawn(entry, await readForView(entry.file, entry.file.name, entry.pieces));
    } catch {
      entry.unreadable = true;
      void this.explain(entry);
    }
    this.changed();
  }

  private drawn(entry: Entry, shown: Shown): void {
    entry.shown = shown;
    entry.unreadable = false;
    entry.zUp = isZUp(entry.file.name, shown.positions);
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
      const answer = await backend.classify(entry.files, model, (share, bytes) => {
        if (entry.model !== model) return;
        entry.state = share < 1 ? { step: "sending", share, bytes } : { step: "waiting" };
        this.changed();
      });
      if (entry.model !== model || !this.entries.includes(entry)) return;
      await this.answered(entry, answer);
    } catch (error) {
      this.fail(entry, api.asRefused(error));
    }
  }

  private async answered(entry: Entry, answer: api.Answer): Promise<void> {
    entry.state = { step: "done", answer };
    this.say(`${entry.file.name}: ${verdict(answer)}`);
    this.changed();
    await this.look(entry);
  }

  /** Ask what more is to be shown of an entry that has an answer. */
  private async look(entry: Entry): Promise<void> {
    await this.explain(entry);
    if (entry === this.current) await this.compare(entry);
  }

  /** Compute the evidence that is to be shown. What the page cannot read itself is drawn by it. */
  private async explain(entry: Entry): Promise<void> {
    const wanted = (entry === this.current && this.evidence) || entry.unreadable;
    if (!wanted || !entry.answer || !this.explains(entry)) return;
    const { label } = entry;
    if (entry.explained.has(label)) return;
    entry.explaining?.abort();
    const control = (entry.explaining = new AbortController());
    entry.explainError = null;
    this.changed();
    const work = () => this.explained(entry, label, control.signal);
    const found = await this.attempt(entry, work, control.signal);
    if (entry.explaining === control) entry.explaining = null;
    if (found && this.evidence && entry === this.current) {
      this.say(`The surface shows the evidence for ${plain(label)}`);
    }
    this.changed();
  }

  /** Ask the other models, where the answer is weak. Rough probabilities are never surer. */
  private async compare(entry: Entry): Promise<void> {
    const { answer, model } = entry;
    if (!answer || !isWeak(answer) || entry.surer !== undefined) return;
    entry.surer = null;
    for (const { name } of this.models) {
      if (name === model) continue;
      const other = await backend.classify(entry.files, name, () => {}).catch(() => null);
      if (entry.model !== model) return;
      const least = entry.surer?.probability ?? (answer.unknown ? 0 : answer.probability);
      if (other && !isRough(other) && !isWeak(other) && other.probability > least) entry.surer = other;
    }
    this.changed();
  }

  private fail(entry: Entry, error: api.Refused): void {
    if (!this.entries.includes(entry)) return;
    entry.state = { step: "failed", error };
    this.say(`${entry.file.name}: ${error.title}. ${error.message}`);
    this.changed();
  }

  /** The result of work on an answered entry, or null when the entry says why there is none. */
  private async attempt<Value>(
    entry: Entry,
    work: () => Promise<Value>,
    signal?: AbortSignal,
  ): Promise<Value | null> {
    try {
      return await work();
    } catch (error) {
      if (signal?.aborted || !this.entries.includes(entry)) return null;
      entry.explainError = api.asRefused(error);
      this.say(entry.explainError.message);
      this.changed();
      return null;
    }
  }

  private async explained(entry: Entry, label: string, signal?: AbortSignal): Promise<Explained> {
    const known = entry.explained.get(label);
    if (known) return known;
    const { model } = entry;
    const glb = await backend.explain(entry.files, { model, class: label }, "glb", signal);
    const [legend, shown] = await Promise.all([legendOf(glb), readForView(glb, "a.glb", [], true)]);
    signal?.throwIfAborted();
    const explained = { glb, legend, shown };
    if (entry.model === model) entry.explained.set(label, explained);
    if (entry.unreadable) this.drawn(entry, { ...shown, colours: null });
    return explained;
  }
}

/** The legend that the service wrote into a GLB. */
async function legendOf(glb: Blob): Promise<Legend> {
  const length = new DataView(await glb.slice(12, 16).arrayBuffer()).getUint32(0, true);
  const text = await glb.slice(20, 20 + length).text();
  return (JSON.parse(text) as { nodes: { extras: Legend }[] }).nodes[0].extras;
}
