// The page: files come in, are drawn at once, classified, and explained when asked.

import * as api from "./api";
import { byId, make } from "./dom";
import { Entry, type Explained, type Legend } from "./entries";
import { panel } from "./panel/result";
import { EXTENSIONS, isZUp } from "./parsing/formats";
import { readForView } from "./parsing";
import { entryCard, picture, sampleCard } from "./shelf";
import { thumbnail } from "./thumbnails";
import { Viewer } from "./viewer";
import { megabytes, verdict } from "./words";

const AT_ONCE = 2;

const result = byId("result");
const canvas = byId<HTMLCanvasElement>("view");
const modelPicker = byId<HTMLSelectElement>("model");
const fileInput = byId<HTMLInputElement>("files");
const spin = byId<HTMLButtonElement>("spin");
const upright = byId<HTMLButtonElement>("upright");

const entries: Entry[] = [];
let models: api.Model[] = [];
let mostBytes = Infinity;
let current: Entry | null = null;
let running = 0;
const queue: Entry[] = [];

const viewer = (() => {
  try {
    return new Viewer(canvas);
  } catch {
    return null;
  }
})();

// --- what is there -----------------------------------------------------------------------------

function add(files: Iterable<File>): void {
  const added = [...files].map((file) => new Entry(file, isZUp(file.name), modelPicker.value));
  if (!added.length) return;
  entries.push(...added);
  for (const entry of added) {
    void draw(entry);
    ask(entry);
  }
  select(added[0]);
}

function select(entry: Entry): void {
  const moved = current !== entry;
  current = entry;
  if (moved) showMesh();
  render();
}

async function draw(entry: Entry): Promise<void> {
  try {
    entry.shown = await readForView(entry.file, entry.file.name);
    entry.picture = thumbnail(entry.shown, entry.zUp);
  } catch {
    entry.unreadable = true;
    if (entry.answer) void explainUnread(entry);
  }
  if (entry === current) showMesh();
  render();
}

// --- asking the service ------------------------------------------------------------------------

function ask(entry: Entry): void {
  entry.state = { step: "sending", share: 0 };
  entry.model = modelPicker.value;
  entry.explained.clear();
  entry.chosen = entry.explainError = null;
  if (entry.file.size > mostBytes) {
    const words = `It has ${megabytes(entry.file.size)}; the service takes ${megabytes(mostBytes)}. Simplify the mesh, or use a binary format (STL, PLY, GLB).`;
    fail(entry, new api.Refused("This file is too large", words, false));
    return;
  }
  queue.push(entry);
  next();
}

function next(): void {
  while (running < AT_ONCE && queue.length) {
    running++;
    void classify(queue.shift()!).finally(() => {
      running--;
      next();
    });
  }
}

async function classify(entry: Entry): Promise<void> {
  try {
    const answer = await api.classify(entry.file, entry.model, (share) => {
      entry.state = share < 1 ? { step: "sending", share } : { step: "waiting" };
      render();
    });
    entry.state = { step: "done", answer };
    announce(`${entry.file.name}: ${verdict(answer)}`);
    if (entry.unreadable) void explainUnread(entry);
  } catch (error) {
    fail(entry, asRefused(error));
  }
  render();
}

function fail(entry: Entry, error: api.Refused): void {
  entry.state = { step: "failed", error };
  announce(`${entry.file.name}: ${error.title}. ${error.message}`);
  render();
}

const asRefused = (error: unknown) =>
  error instanceof api.Refused
    ? error
    : new api.Refused("This page failed", String(error), true);

const explains = (entry: Entry) =>
  models.find(({ name }) => name === entry.model)?.config.pooling !== "learned";

/** Files that the page cannot draw are drawn as the service sees them. */
async function explainUnread(entry: Entry): Promise<void> {
  if (explains(entry)) await choose(entry, entry.answer!.class);
}

/** Show the evidence for a class, or the bare mesh if it is shown already. */
async function choose(entry: Entry, label: string): Promise<void> {
  entry.explainError = null;
  if (entry.chosen === label) {
    entry.chosen = null;
  } else {
    try {
      await fetchExplained(entry, label);
    } catch (error) {
      entry.explainError = asRefused(error);
      announce(entry.explainError.message);
      render();
      return;
    }
    entry.chosen = label;
    announce(`The surface shows the evidence for ${label}`);
  }
  if (entry === current) showMesh();
  render();
}

async function fetchExplained(entry: Entry, label: string): Promise<Explained> {
  const known = entry.explained.get(label);
  if (known) return known;
  entry.explaining = label;
  render();
  try {
    const glb = await api.explain(entry.file, entry.model, label, "model/gltf-binary");
    const [legend, shown] = await Promise.all([legendOf(glb), readForView(glb, "a.glb", true)]);
    const explained = { glb, legend, shown };
    entry.explained.set(label, explained);
    return explained;
  } finally {
    entry.explaining = null;
  }
}

/** The legend that the service wrote into a GLB. */
async function legendOf(glb: Blob): Promise<Legend> {
  const length = new DataView(await glb.slice(12, 16).arrayBuffer()).getUint32(0, true);
  const text = await glb.slice(20, 20 + length).text();
  return (JSON.parse(text) as { nodes: { extras: Legend }[] }).nodes[0].extras;
}

async function save(entry: Entry, form: "glb" | "ply" | "json"): Promise<void> {
  const label = entry.chosen ?? entry.answer!.class;
  try {
    let blob: Blob;
    if (form === "glb") blob = (await fetchExplained(entry, label)).glb;
    else if (form === "ply") blob = await api.explain(entry.file, entry.model, label, "model/ply");
    else if (explains(entry)) {
      blob = await api.explain(entry.file, entry.model, label, "application/json");
    } else blob = new Blob([JSON.stringify(entry.answer, null, 2)]);
    const link = make("a", {
      href: URL.createObjectURL(blob),
      download: `${entry.file.name}-${label}.${form}`,
    });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  } catch (error) {
    entry.explainError = asRefused(error);
  }
  render();
}

// --- showing -----------------------------------------------------------------------------------

function showMesh(): void {
  if (!current) return;
  const shown = (current.chosen && current.explained.get(current.chosen)?.shown) || current.shown;
  if (shown) viewer?.show(shown, current.zUp);
  else viewer?.clear();
}

function render(): void {
  if (!current) return;
  byId("empty").hidden = true;
  canvas.hidden = !viewer;
  byId("tools").hidden = !viewer;
  upright.setAttribute("aria-pressed", String(current.zUp));
  renderNote(current);
  renderLegend(current);
  renderPanel(current);
  const list = byId("entries");
  byId("shelf").hidden = entries.length < 2;
  keepFocus(list, () =>
    list.replaceChildren(
      ...entries.map((entry) => entryCard(entry, entry === current, () => select(entry))),
    ),
  );
}

function renderPanel(entry: Entry): void {
  keepFocus(result, () =>
    result.replaceChildren(
      ...panel(entry, explains(entry), {
        choose: (label) => void choose(entry, label),
        retry: () => ask(entry),
        save: (form) => void save(entry, form),
      }),
    ),
  );
}

/** Elements are made anew; the one in the place of the focused one gets its focus. */
function keepFocus(box: HTMLElement, change: () => void): void {
  const buttons = () => [...box.querySelectorAll("button")];
  const index = buttons().indexOf(document.activeElement as HTMLButtonElement);
  change();
  if (index >= 0) buttons()[index]?.focus({ preventScroll: true });
}

function renderNote(entry: Entry): void {
  const note = byId("view-note");
  const shown = (entry.chosen && entry.explained.get(entry.chosen)?.shown) || entry.shown;
  const few = shown && shown.positions.length / 9 < shown.faces;
  note.textContent = !viewer
    ? "This browser shows no 3D (WebGL is off). The result does not need it."
    : entry.unreadable && !shown
      ? "This page cannot draw the file."
      : few
        ? `Drawn with ${(shown.positions.length / 9 / 1000).toFixed(0)} of ${(shown.faces / 1000).toFixed(0)} thousand faces.`
        : shown
          ? ""
          : "Reading …";
  note.hidden = !note.textContent;
  const words = entry.chosen ? `evidence for ${entry.chosen} in colours` : "in grey";
  canvas.setAttribute("aria-label", `${entry.file.name} in 3D, ${words}`);
  canvas.dataset.shows = shown ? (entry.chosen ?? "mesh") : "nothing";
}

function renderLegend(entry: Entry): void {
  const legend = entry.chosen ? entry.explained.get(entry.chosen)?.legend : undefined;
  byId("legend").hidden = !legend;
  if (!legend) return;
  byId("legend-title").textContent = `What speaks for ${legend.class}`;
  byId("legend-scale").style.background = `linear-gradient(90deg, ${legend.colours.join(", ")})`;
}

function announce(words: string): void {
  byId("status").textContent = words;
}

// --- what people do ----------------------------------------------------------------------------

for (const id of ["choose", "choose-empty"]) byId(id).onclick = () => fileInput.click();
fileInput.accept = EXTENSIONS.map((extension) => `.${extension}`).join(",");
fileInput.onchange = () => {
  add(fileInput.files ?? []);
  fileInput.value = "";
};

addEventListener("dragover", (event) => {
  event.preventDefault();
  byId("drop-hint").hidden = false;
});
addEventListener("dragleave", (event) => {
  if (!event.relatedTarget) byId("drop-hint").hidden = true;
});
addEventListener("drop", (event) => {
  event.preventDefault();
  byId("drop-hint").hidden = true;
  add(event.dataTransfer?.files ?? []);
});

modelPicker.onchange = () => entries.forEach(ask);

function setSpinning(on: boolean): void {
  spin.setAttribute("aria-pressed", String(on));
  if (viewer) viewer.spinning = on;
}
spin.onclick = () => setSpinning(spin.getAttribute("aria-pressed") !== "true");
setSpinning(!matchMedia("(prefers-reduced-motion: reduce)").matches);
if (viewer) viewer.onTouched = () => setSpinning(false);
byId("reset").onclick = () => viewer?.reset();
upright.onclick = () => {
  if (!current) return;
  current.zUp = !current.zUp;
  if (current.shown) current.picture = thumbnail(current.shown, current.zUp);
  showMesh();
  render();
};

// --- at the start ------------------------------------------------------------------------------

async function start(): Promise<void> {
  byId("accepted").textContent = EXTENSIONS.map((extension) => extension.toUpperCase()).join(" · ");
  const [served, limits] = await Promise.all([api.models(), api.limits()]);
  models = served;
  mostBytes = limits.upload_bytes;
  byId("accepted").textContent += `, up to ${megabytes(mostBytes)}`;
  modelPicker.append(...models.map(({ name }) => new Option(name)));
  byId("picker").hidden = false;
  await showSamples();
}

async function showSamples(): Promise<void> {
  const list = byId("sample-list");
  const waiting: [api.Sample, HTMLElement][] = [];
  for (const sample of await api.samples()) {
    const { card, image } = sampleCard(sample, () => {
      api.sampleFile(sample).then(
        (file) => add([file]),
        (error) => announce(asRefused(error).message),
      );
    });
    list.append(card);
    waiting.push([sample, image]);
  }
  byId("samples").hidden = false;
  for (const [sample, image] of waiting) {
    const file = await api.sampleFile(sample);
    const shown = await readForView(file, file.name);
    image.replaceWith(picture(thumbnail(shown, isZUp(file.name))));
  }
}

start().catch((error) => {
  const { title, message } = asRefused(error);
  result.replaceChildren(
    make("h2", { className: "verdict failed", textContent: title }),
    make("p", { className: "reason", textContent: message }),
  );
  announce(`${title}. ${message}`);
});
