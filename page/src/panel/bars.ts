// The classes as bars, likeliest first; each is a button that shows its evidence.

import type { Answer } from "../api";
import { make } from "../dom";
import type { Entry } from "../entries";
import { plain, probabilityIn } from "../words";
import type { Actions } from "./result";

const FEW = 5;

/** shows: the class whose evidence is on the surface. actions: null where the model cannot explain. */
export function bars(
  answer: Answer,
  entry: Entry,
  shows: string | null,
  actions: Actions,
  explains: boolean,
): HTMLElement {
  const box = make("section", {}, make("h3", { textContent: "Classes" }));
  const hint = explains
    ? "Choose one to see what speaks for it."
    : "This model pools by learned features, and cannot show its evidence.";
  box.append(make("p", { className: "quiet", textContent: hint }));
  const listed = entry.allClasses ? answer.scores : answer.scores.slice(0, FEW);
  const list = make("ol", { className: answer.unknown ? "bars unknown" : "bars" });
  for (const { class: label, probability } of listed) {
    const choose = explains ? () => actions.choose(label) : null;
    const words = probabilityIn(answer, probability);
    list.append(make("li", {}, bar(label, probability, words, shows === label, choose)));
  }
  box.append(list);
  if (answer.scores.length > FEW) {
    const words = entry.allClasses ? "Fewer classes" : `All ${answer.scores.length} classes`;
    const more = { type: "button", className: "more", textContent: words, onclick: actions.expand };
    box.append(make("button", more as Partial<HTMLButtonElement>));
  }
  return box;
}

function bar(
  label: string,
  probability: number,
  words: string,
  shown: boolean,
  choose: (() => void) | null,
): HTMLElement {
  const fill = make("span", { className: "bar-fill" });
  fill.style.width = `${Math.max(0.4, 100 * probability)}%`;
  const parts = [
    make("span", { className: "bar-name", textContent: plain(label) }),
    make("span", { className: "bar-value", textContent: words }),
    make("span", { className: "bar", ariaHidden: "true" }, fill),
  ];
  if (!choose) return make("div", { className: "class-row" }, ...parts);
  const button = make(
    "button",
    { type: "button", className: "class-row", aria: { pressed: String(shown) }, onclick: choose },
    ...parts,
  );
  button.dataset.class = label;
  return button;
}
