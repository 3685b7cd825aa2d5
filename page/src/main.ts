// The page: wires what people do to the visit, and the visit to what is shown.

import * as api from "./api";
import { byId, make } from "./dom";
import { chosen, dropped, gathered, type Found } from "./files";
import { KeyForm } from "./key";
import { panel } from "./panel/result";
import { readForView } from "./parsing";
import { isZUp } from "./parsing/formats";
import { entryCard, picture, sampleCard } from "./shelf";
import { Stage } from "./stage";
import { thumbnail } from "./thumbnails";
import { type Form, Visit } from "./visit";
import { megabytes } from "./words";

const result = byId("result");
const entryList = byId("entries");
const modelPicker = byId<HTMLSelectElement>("model");
const fileInput = byId<HTMLInputElement>("files");
const dropHint = byId("drop-hint");

const say = (words: string) => {
  byId("status").textContent = words;
};
const visit = new Visit(render, say);
const stage = new Stage(() => visit.current && visit.turnUpright(visit.current));
const keyForm = new KeyForm(() => (visit.models.length ? askAgain() : begin()));
let extensions: string[] = []; // of files that the service reads
const add = async (found: Found[]) =>
  visit.add(await gathered(found, extensions), modelPicker.value);

function render(): void {
  const refused = visit.entries.find((one) => one.error?.wantsKey)?.error;
  if (refused) keyForm.ask(refused);
  const entry = visit.current;
  if (!entry) return;
  stage.show(entry, visit.explains(entry));
  keepFocus(result, () =>
    result.replaceChildren(
      ...panel(entry, visit.explains(entry), {
        choose: (label) => void visit.choose(entry, label),
        retry: () => visit.ask(entry, modelPicker.value),
        save: (form) => void save(form),
        search: visit.library && (() => void visit.search(entry)),
      }),
    ),
  );
  byId("shelf").hidden = visit.entries.length < 2;
  keepFocus(entryList, () =>
    entryList.replaceChildren(
      ...visit.entries.map((one) => entryCard(one, one === entry, () => visit.select(one))),
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

async function save(form: Form): Promise<void> {
  const file = await visit.download(visit.current!, form);
  if (!file) return;
  const link = make("a", { href: URL.createObjectURL(file), download: file.name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

function listen(): void {
  for (const id of ["choose", "choose-empty"]) byId(id).onclick = () => fileInput.click();
  fileInput.onchange = () => {
    void add(chosen(fileInput.files ?? []));
    fileInput.value = "";
  };
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    dropHint.hidden = false;
  });
  document.addEventListener("dragleave", (event) => {
    dropHint.hidden = !event.relatedTarget;
  });
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    dropHint.hidden = true;
    if (event.dataTransfer) void dropped(event.dataTransfer).then(add);
  });
  modelPicker.onchange = () => {
    for (const entry of visit.entries) visit.ask(entry, modelPicker.value);
  };
}

/** Ask anew for what failed for want of a key. */
function askAgain(): void {
  for (const entry of visit.entries) {
    if (entry.error?.wantsKey) visit.ask(entry, modelPicker.value);
  }
}

async function start(): Promise<void> {
  const [models, limits, read, library] = await Promise.all([
    api.models(),
    api.limits(),
    api.formats(),
    api.library(),
  ]);
  visit.library = library;
  const installed = read.filter((format) => !format.missing_extra);
  extensions = installed.flatMap(({ extension, aliases }) => [extension, ...aliases]);
  fileInput.accept = [...extensions, "bin"].map((extension) => `.${extension}`).join(",");
  visit.models = models;
  visit.mostBytes = limits.upload_bytes;
  const formats = installed.map(({ extension }) => extension.toUpperCase()).join(" · ");
  byId("accepted").textContent = `${formats}, up to ${megabytes(limits.upload_bytes)}`;
  modelPicker.replaceChildren(...models.map(({ name }) => new Option(name)));
  byId("picker").hidden = false;
  await showSamples();
}

async function showSamples(): Promise<void> {
  const samples = await api.samples();
  const cards = samples.map((sample) => sampleCard(sample, () => void open(sample)));
  byId("sample-list").replaceChildren(...cards.map(({ card }) => card));
  byId("samples").hidden = false;
  for (const [i, { image }] of cards.entries()) {
    const file = await api.sampleFile(samples[i]);
    const shown = await readForView(file, file.name).catch(() => visit.servedMesh(file));
    image.replaceWith(picture(shown && thumbnail(shown, isZUp(file.name))));
  }
}

async function open(sample: api.Sample): Promise<void> {
  try {
    await add(chosen([await api.sampleFile(sample)]));
  } catch (error) {
    const refused = api.asRefused(error);
    if (refused.wantsKey) keyForm.ask(refused);
    else say(refused.message);
  }
}

function begin(): void {
  result.replaceChildren();
  start().catch((error) => {
    const refused = api.asRefused(error);
    if (refused.wantsKey) {
      keyForm.ask(refused);
      return;
    }
    result.replaceChildren(
      make("h2", { className: "verdict failed", textContent: refused.title }),
      make("p", { className: "reason", textContent: refused.message }),
    );
    say(`${refused.title}. ${refused.message}`);
  });
}

listen();
begin();
