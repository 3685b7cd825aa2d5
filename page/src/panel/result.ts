// The panel beside the view: what one file is, or why it is nothing.

import type { Answer, Refused } from "../api";
import { make } from "../dom";
import type { Entry } from "../entries";
import type { Form } from "../visit";
import { describe, megabytes, percent, plain } from "../words";
import { alike } from "./alike";
import { bars } from "./bars";

// Below this probability, more than one answer in three is wrong.
const WEAK = 2 / 3;

export interface Actions {
  choose(label: string): void;
  retry(): void;
  save(form: Form): void;
  /** null where the service has no library. */
  search: (() => void) | null;
}

/** The content of the panel for an entry. */
export function panel(entry: Entry, explains: boolean, actions: Actions): HTMLElement[] {
  const title = make("p", { className: "file-name", textContent: entry.file.name });
  const { state } = entry;
  if (state.step === "failed") return [title, ...failure(state.error, actions)];
  if (state.step === "done") return [title, ...success(entry, state.answer, explains, actions)];
  const sending = state.step === "sending";
  const bar = make("progress", { max: 1, aria: { label: sending ? "Upload" : "Classification" } });
  if (sending) bar.value = state.share;
  const words = sending
    ? `Sending ${megabytes(entry.file.size)} … ${Math.round(100 * state.share)} %`
    : "Looking at it …";
  return [title, make("h2", { className: "verdict waiting", textContent: words }), bar];
}

function failure(error: Refused, actions: Actions): HTMLElement[] {
  const parts: HTMLElement[] = [
    make("h2", { className: "verdict failed", textContent: error.title }),
    make("p", { className: "reason", textContent: error.message }),
  ];
  if (error.again) {
    parts.push(make("button", { type: "button", textContent: "Try again", onclick: actions.retry }));
  }
  if (error.requestId) {
    parts.push(make("p", { className: "quiet", textContent: `Request ${error.requestId}` }));
  }
  return parts;
}

function success(
  entry: Entry,
  answer: Answer,
  explains: boolean,
  actions: Actions,
): HTMLElement[] {
  return [
    ...verdict(answer),
    bars(answer, entry, explains ? actions.choose : null),
    ...(actions.search ? [alike(entry, actions.search)] : []),
    section("The mesh", ...describe(answer.mesh).map((text) => make("p", { textContent: text }))),
    make("details", {}, make("summary", { textContent: "Time" }), timings(answer)),
    section("Take it with you", downloads(entry, explains, actions)),
  ];
}

function verdict(answer: Answer): HTMLElement[] {
  if (answer.unknown) {
    return [
      make("h2", { className: "verdict unknown", textContent: "Unknown" }),
      make("p", {
        className: "confidence",
        textContent: `Unlike everything that ${answer.model.name} knows. Nearest is ${plain(answer.class)}, at ${percent(answer.probability)}.`,
      }),
    ];
  }
  const right = Math.min(99, Math.round(100 * answer.probability));
  const [first, second] = answer.scores.map((score) => plain(score.class));
  const weak = answer.probability < WEAK && second;
  return [
    make("h2", {
      className: "verdict",
      textContent: weak ? `Probably ${first}, or ${second}` : first,
    }),
    make("p", {
      className: "confidence",
      textContent: `Of 100 such answers of ${answer.model.name}, ${right} are right.`,
    }),
  ];
}

function section(title: string, ...content: HTMLElement[]): HTMLElement {
  return make("section", {}, make("h3", { textContent: title }), ...content);
}

const STAGES: Record<string, string> = {
  read: "read",
  prepare: "prepare",
  topology: "topology",
  infer: "network",
};

function timings(answer: Answer): HTMLElement {
  const stages = Object.entries(answer.timings_ms);
  const list = make("dl", { className: "timings" });
  const total = stages.reduce((sum, [, ms]) => sum + ms, 0);
  for (const [name, ms] of [...stages, ["total", total] as const]) {
    list.append(
      make(
        "div",
        {},
        make("dt", { textContent: STAGES[name] ?? name }),
        make("dd", { textContent: `${ms < 10 ? ms.toFixed(1) : Math.round(ms)} ms` }),
      ),
    );
  }
  return list;
}

function downloads(entry: Entry, explains: boolean, actions: Actions): HTMLElement {
  const row = make("div", { className: "downloads" });
  const button = (form: Form, text: string) =>
    make("button", { type: "button", textContent: text, onclick: () => actions.save(form) });
  if (explains) {
    const label = entry.chosen ?? entry.answer!.class;
    row.append(button("glb", "Coloured mesh (GLB)"), button("ply", "PLY"));
    row.setAttribute("aria-label", `Evidence for ${plain(label)}`);
    row.setAttribute("role", "group");
  }
  row.append(button("json", "JSON"));
  return row;
}
