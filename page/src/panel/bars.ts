// The classes as bars, likeliest first; each is a button that shows its evidence.

import type { Answer } from "../api";
import { make } from "../dom";
import type { Entry } from "../entries";
import { percent, plain } from "../words";

const FEW = 5;

/** choose: what a click on a class does, or null where the model cannot explain. */
export function bars(
  answer: Answer,
  entry: Entry,
  choose: ((label: string) => void) | null,
): HTMLElement {
  const all = answer.scores.map((score) => bar(score.class, score.probability, entry, choose));
  const list = make("ol", { className: "bars" }, ...all.slice(0, FEW));
  const box = make("section", {}, make("h3", { textContent: "Classes" }));
  if (!choose) {
    const hint = "This model pools by learned features, and cannot show its evidence.";
    box.append(make("p", { className: "quiet", textContent: hint }));
  }
  box.append(list);
  if (entry.explainError) {
    box.append(make("p", { className: "reason", textContent: entry.explainError.message }));
  }
  if (all.length > FEW) {
    const more = make("button", {
      type: "button",
      className: "more",
      textContent: `All ${all.length} classes`,
    });
    const showAll = () => {
      list.append(...all.slice(FEW));
      more.remove();
      entry.allClasses = true;
    };
    more.onclick = () => {
      showAll();
      all[FEW].querySelector("button")?.focus();
    };
    box.append(more);
    if (entry.allClasses) showAll();
  }
  return box;
}

const isOnItsWay = (entry: Entry, label: string) =>
  entry.wanted === label && entry.chosen !== label;

function bar(
  label: string,
  probability: number,
  entry: Entry,
  choose: ((label: string) => void) | null,
): HTMLElement {
  const fill = make("span", { className: "bar-fill" });
  fill.style.width = `${Math.max(0.4, 100 * probability)}%`;
  const parts = [
    make("span", { className: "bar-name", textContent: plain(label) }),
    make("span", { className: "bar-value", textContent: percent(probability) }),
    make("span", { className: "bar", ariaHidden: "true" }, fill),
  ];
  if (!choose) return make("li", {}, make("div", { className: "class-row" }, ...parts));
  const button = make(
    "button",
    {
      type: "button",
      className: "class-row",
      aria: { pressed: String(entry.chosen === label), busy: String(isOnItsWay(entry, label)) },
      onclick: () => choose(label),
    },
    ...parts,
  );
  button.dataset.class = label;
  return make("li", {}, button);
}
