// The tiles of the files, filtered and in order. Names become text, never markup.

"use strict";

const PAGE = 240; // tiles that are made at once

const ORDERS = {
  doubtful: (a, b) => probability(a) - probability(b),
  certain: (a, b) => probability(b) - probability(a),
  class: (a, b) => compare(label(a), label(b)) || probability(a) - probability(b),
  file: (a, b) => compare(a.file, b.file),
  slow: (a, b) => b.milliseconds - a.milliseconds,
};

const at = (selector, within = document) => within.querySelector(selector);
const all = (selector) => [...document.querySelectorAll(selector)];
const label = (entry) => entry.likeliest[0][0];
const probability = (entry) => entry.likeliest[0][1];
const percent = (share) => `${(100 * share).toFixed(1)} %`;
const compare = new Intl.Collator("en", { numeric: true }).compare;

const entries = JSON.parse(at("#entries").textContent);
for (const entry of entries) entry.searched = `${entry.file}\n${label(entry)}`.toLowerCase();

const form = at("#filter");
const fields = form.elements;
const tiles = at("#tiles");
const more = at("#more");
const detail = at("#detail");
let found = [];
let open = 0; // index in `found` of the file in the dialog

function element(name, className, text) {
  const made = document.createElement(name);
  made.className = className;
  made.textContent = text;
  return made;
}

function show(image, entry) {
  image.hidden = !entry.picture;
  if (entry.picture) image.src = `data:image/png;base64,${entry.picture}`;
}

function tile(entry, index) {
  const button = element("button", entry.unknown ? "tile unknown" : "tile", "");
  button.dataset.index = index;
  const stage = element("span", "stage", "");
  const image = new Image(96, 96);
  image.alt = "";
  image.decoding = "async";
  show(image, entry);
  stage.append(image);
  const title = element("bdi", "title", entry.unknown ? "unknown" : label(entry));
  const line = element("span", "line", "");
  const share = entry.unknown ? "" : percent(probability(entry));
  const name = element("bdi", "file", entry.file.split(/[/\\]/).pop());
  line.append(name, element("span", "share", share));
  button.append(stage, title, line);
  const item = document.createElement("li");
  item.append(button);
  return item;
}

function showMore() {
  const from = tiles.childElementCount;
  const next = found.slice(from, from + PAGE);
  tiles.append(...next.map((entry, i) => tile(entry, from + i)));
  more.hidden = tiles.childElementCount === found.length;
}

function matches(entry) {
  const { text, which, low, high } = fields;
  const share = 100 * probability(entry);
  const most = Number(high.value);
  return (
    (which.value === "all" || entry.unknown === (which.value === "unknown")) &&
    (!fields.class.value || label(entry) === fields.class.value) &&
    share >= Number(low.value) &&
    (share < most || most >= 100) &&
    entry.searched.includes(text.value.toLowerCase())
  );
}

function pressed() {
  const { which, low, high } = fields;
  for (const bar of all(".bar")) {
    const chosen =
      bar.dataset.class === undefined
        ? which.value === "unknown"
        : which.value !== "unknown" && fields.class.value === bar.dataset.class;
    bar.setAttribute("aria-pressed", chosen);
  }
  for (const bin of all(".histogram button")) {
    const chosen = low.value === bin.dataset.low && high.value === bin.dataset.high;
    bin.setAttribute("aria-pressed", chosen);
  }
}

function filter() {
  found = entries.filter(matches).sort(ORDERS[fields.order.value]);
  tiles.replaceChildren();
  showMore();
  pressed();
  at("#found").textContent = found.length === 1 ? "1 file" : `${found.length} files`;
}

function alike(entry) {
  const button = element("button", "stage", entry.picture ? "" : entry.file);
  button.type = "button";
  button.title = entry.file;
  button.setAttribute("aria-label", entry.file);
  const image = new Image(64, 64);
  image.alt = "";
  show(image, entry);
  button.append(image);
  button.addEventListener("click", () => {
    if (!found.includes(entry)) {
      form.reset();
      fields.which.value = "unknown";
      filter();
    }
    openDetail(found.indexOf(entry));
  });
  return button;
}

function openDetail(index) {
  open = index;
  const entry = found[index];
  show(at("img", detail), entry);
  at("h2", detail).textContent = entry.unknown ? "unknown" : label(entry);
  const rows = entry.likeliest.map(([name, share]) => {
    const row = document.createElement("li");
    row.append(element("bdi", "", name), element("span", "share", percent(share)));
    return row;
  });
  at("ol", detail).replaceChildren(...rows);
  at(".path bdi", detail).textContent = entry.file;
  const nearest = entry.unknown ? "Unlike every class; above are the nearest. " : "";
  at(".hint", detail).textContent = `${nearest}${entry.faces} faces, ${entry.milliseconds} ms`;
  at("#alike").hidden = entry.alike.length === 0;
  at(".alike", detail).replaceChildren(...entry.alike.map((place) => alike(entries[place])));
  at("[data-step='-1']", detail).disabled = index === 0;
  at("[data-step='1']", detail).disabled = index === found.length - 1;
  if (!detail.open) detail.showModal();
}

function walk(step) {
  if (found[open + step]) openDetail(open + step);
}

function choose(bar) {
  const undo = bar.getAttribute("aria-pressed") === "true";
  if (bar.dataset.class !== undefined) {
    fields.class.value = undo ? "" : bar.dataset.class;
    fields.which.value = "known";
  } else if (bar.dataset.unknown !== undefined) {
    fields.class.value = "";
    fields.which.value = undo ? "known" : "unknown";
  } else {
    fields.low.value = undo ? 0 : bar.dataset.low;
    fields.high.value = undo ? 100 : bar.dataset.high;
    fields.which.value = "known";
  }
  filter();
  const files = at("#files");
  const { top } = files.getBoundingClientRect();
  if (top < 0 || top > innerHeight / 2) files.scrollIntoView();
}

for (const name of [...new Set(entries.map(label))].sort(compare)) {
  fields.class.append(new Option(name, name));
}
for (const bar of all(".bar, .histogram button")) bar.addEventListener("click", () => choose(bar));
form.addEventListener("input", filter);
form.addEventListener("submit", (event) => event.preventDefault());
form.addEventListener("reset", () => setTimeout(filter));
more.addEventListener("click", showMore);
new IntersectionObserver(([seen]) => seen.isIntersecting && showMore(), {
  rootMargin: "800px",
}).observe(more);
tiles.addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (button) openDetail(Number(button.dataset.index));
});
detail.addEventListener("click", (event) => {
  if (event.target.dataset.step) walk(Number(event.target.dataset.step));
});
detail.addEventListener("keydown", (event) => {
  if (event.key === "ArrowRight") walk(1);
  if (event.key === "ArrowLeft") walk(-1);
});
detail.addEventListener("close", () => at(`[data-index="${open}"]`)?.focus());
filter();
