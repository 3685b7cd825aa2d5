// The page: wires what people do to the visit, and the visit to what is shown.

import * as api from "./api";
import { backend, isLocal } from "./backend";
import { csvOf } from "./csv";
import { byId, isPressed, make } from "./dom";
import type { Entry } from "./entries";
import { chosen, dropped, gathered, type Found } from "./files";
import { KeyForm } from "./key";
import { ModelMenu } from "./models";
import { type Actions, panel } from "./panel/result";
import { readForView } from "./parsing";
import { byVerdict, entryCard, picture, sampleCard } from "./shelf";
import { Stage } from "./stage";
import { thumbnail } from "./thumbnails";
import { isZUp } from "./upright";
import { Visit } from "./visit";
import { megabytes, passedOverIn } from "./words";

const result = byId("result");
const entryList = byId("entries");
const sorted = byId<HTMLButtonElement>("sort");
const fileInput = byId<HTMLInputElement>("files");
const dropHint = byId("drop-hint");

const say = (words: string) => {
  byId("status").textContent = words;
};
const visit = new Visit(changed, say);
const stage = new Stage(() => visit.current && visit.turnUpright(visit.current));
const keyForm = new KeyForm(() => (visit.models.length ? askAgain() : begin()));
const models = new ModelMenu(() => {
  showAbout();
  for (const entry of visit.entries) visit.ask(entry, models.chosen);
});
let extensions: string[] = []; // of files that are read
const openFiles = byId("choose");
const passedOver = byId("passed-over");

async function add(found: Found[]): Promise<void> {
  const given = await gathered(found, extensions);
  visit.add(given.parts, models.chosen);
  passedOver.textContent = passedOverIn(given.passedOver);
  if (given.passedOver.length) say(passedOver.textContent);
}

/** Say where files go, and what is loaded for the model. */
function showAbout(): void {
  byId("about").textContent = backend.about(models.chosen);
}

let rendering = 0;

function changed(): void {
  cancelAnimationFrame(rendering);
  rendering = requestAnimationFrame(render);
}

function render(): void {
  showAbout();
  const refused = visit.entries.find((one) => one.error?.wantsKey)?.error;
  if (refused) keyForm.ask(refused);
  const entry = visit.current;
  const explains = entry !== null && visit.explains(entry);
  stage.show(entry, explains ? visit.evidence : null, (on) => visit.showEvidence(entry!, on));
  keepFocus(result, result, () =>
    result.replaceChildren(
      ...(entry ? panel(entry, explains, visit.evidence, actionsOn(entry)) : []),
    ),
  );
  byId("shelf").hidden = visit.entries.length < 2;
  const listed = isPressed(sorted) ? byVerdict(visit.entries) : visit.entries;
  const remove = (one: Entry) => visit.remove([one]);
  const select = (one: Entry) => visit.select(one);
  keepFocus(entryList, openFiles, () =>
    entryList.replaceChildren(
      ...listed.map((one) => entryCard(one, one === entry, { select, remove })),
    ),
  );
}

const actionsOn = (entry: Entry): Actions => ({
  choose: (label) => visit.choose(entry, label),
  expand: () => {
    entry.allClasses = !entry.allClasses;
    changed();
  },
  retry: () => visit.ask(entry, entry.model),
  take: (answer) => visit.take(entry, answer),
  save: (form) => save(entry, form),
  search: visit.library && (() => void visit.search(entry)),
});

/** Elements are made anew; the one in the place of the focused one gets its focus, or `otherwise`. */
function keepFocus(box: HTMLElement, otherwise: HTMLElement, change: () => void): void {
  const buttons = () => [...box.querySelectorAll("button")];
  const index = buttons().indexOf(document.activeElement as HTMLButtonElement);
  change();
  if (index < 0) return;
  buttons()[index]?.focus({ preventScroll: true });
  if (document.activeElement === document.body) otherwise.focus({ preventScroll: true });
}

async function save(entry: Entry, form: api.Form): Promise<void> {
  const file = await visit.download(entry, form);
  if (file) download(file);
}

function download(file: File): void {
  const link = make("a", { href: URL.createObjectURL(file), download: file.name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

function listen(): void {
  byId("over-http").hidden = isLocal;
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
  sorted.onclick = () => {
    sorted.setAttribute("aria-pressed", String(!isPressed(sorted)));
    changed();
  };
  byId("clear").onclick = () => {
    visit.remove([...visit.entries]);
    passedOver.textContent = "";
    openFiles.focus();
  };
  byId("csv").onclick = () => download(new File([csvOf(visit.entries)], "meshes.csv"));
}

/** Ask anew for what failed for want of a key. */
function askAgain(): void {
  for (const entry of visit.entries) {
    if (entry.error?.wantsKey) visit.ask(entry, entry.model);
  }
}

async function start(): Promise<void> {
  const [served, limits, read, library] = await Promise.all([
    backend.models(),
    backend.limits(),
    backend.formats(),
    backend.library(),
  ]);
  visit.library = library;
  const installed = read.filter((format) => !format.missing_extra);
  extensions = installed.flatMap(({ extension, aliases }) => [extension, ...aliases]);
  fileInput.accept = [...extensions, "bin"].map((extension) => `.${extension}`).join(",");
  visit.models = served;
  visit.mostBytes = limits.upload_bytes;
  const formats = installed.map(({ extension }) => extension.toUpperCase()).join(" · ");
  byId("accepted").textContent = `${formats}, up to ${megabytes(limits.upload_bytes)}`;
  models.fill(served);
  showAbout();
  await showSamples();
}

async function showSamples(): Promise<void> {
  const samples = await backend.samples();
  const cards = samples.map((sample) => sampleCard(sample, () => void open(sample)));
  byId("sample-list").replaceChildren(...cards.map(({ card }) => card));
  byId("samples").hidden = byId("samples-hint").hidden = false;
  for (const [i, { image }] of cards.entries()) {
    const file = await backend.sampleFile(samples[i]);
    const shown = await readForView(file, file.name).catch(() => null);
    image.replaceWith(picture(shown && thumbnail(shown, isZUp(file.name, shown.positions))));
  }
}

async function open(sample: api.Sample): Promise<void> {
  try {
    await add(chosen([await backend.sampleFile(sample)]));
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
