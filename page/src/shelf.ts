// Meshes side by side: those of this visit, and the samples.

import type { Sample } from "./api";
import { backend } from "./backend";
import { make } from "./dom";
import type { Entry } from "./entries";
import { isRough, plain, verdict } from "./words";

export interface EntryActions {
  select(entry: Entry): void;
  remove(entry: Entry): void;
}

export function entryCard(entry: Entry, current: boolean, actions: EntryActions): HTMLElement {
  const { state } = entry;
  const words = {
    sending: `${backend.verb.toLowerCase()} …`,
    waiting: "looking …",
    done: entry.answer ? verdict(entry.answer) : "",
    failed: "not usable",
  }[state.step];
  const card = make(
    "button",
    {
      type: "button",
      className: `card ${state.step}`,
      title: entry.file.name,
      onclick: () => actions.select(entry),
    },
    picture(entry.picture),
    make("span", { className: "card-name", textContent: entry.file.name }),
    make("span", { className: "card-verdict", textContent: words }),
  );
  if (current) card.setAttribute("aria-current", "true");
  const remove = make("button", {
    type: "button",
    className: "remove",
    textContent: "×",
    title: "Remove",
    aria: { label: `Remove ${entry.file.name}` },
    onclick: () => actions.remove(entry),
  });
  return make("li", {}, card, remove);
}

/** Entries by what they are: class by class, the surest first, and those with rough probabilities
 * after them; then unknown ones, then the rest. */
export function byVerdict(entries: Entry[]): Entry[] {
  const key = ({ answer }: Entry) => (!answer ? "2" : answer.unknown ? "1" : `0${answer.class}`);
  const sureness = ({ answer }: Entry) =>
    answer ? answer.probability - Number(isRough(answer)) : 0;
  return entries.toSorted((a, b) => key(a).localeCompare(key(b)) || sureness(b) - sureness(a));
}

/** A sample's card, and the place of its picture, which comes later. */
export function sampleCard(sample: Sample, open: () => void): { card: HTMLElement; image: HTMLElement } {
  const image = picture(null);
  const button = make(
    "button",
    { type: "button", className: "card", onclick: open },
    image,
    make("span", { className: "card-name", textContent: plain(sample.name) }),
    make("span", { className: "card-verdict", textContent: sample.file.split(".").pop()! }),
  );
  return { card: make("li", {}, button), image };
}

export function picture(source: string | null): HTMLElement {
  const frame = make("span", { className: "picture" });
  if (source) frame.append(make("img", { src: source, alt: "" }));
  return frame;
}
