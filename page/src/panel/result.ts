// The panel beside the view: what one file is, or why it is nothing.

import type { Answer, Form, Refused } from "../api";
import { backend } from "../backend";
import { make } from "../dom";
import type { Entry } from "../entries";
import { describe, isRough, isWeak, megabytes, plain, rightOf100 } from "../words";
import { alike } from "./alike";
import { bars } from "./bars";

export interface Actions {
  choose(label: string): void;
  expand(): void;
  retry(): void;
  take(answer: Answer): void;
  save(form: Form): Promise<void>;
  /** null where there is no library. */
  search: (() => void) | null;
}

/** The content of the panel for an entry. explains: whether its model can; evidence: whether it is
 * shown. */
export function panel(
  entry: Entry,
  explains: boolean,
  evidence: boolean,
  actions: Actions,
): HTMLElement[] {
  const title = make(
    "p",
    { className: "file-line" },
    make("span", { className: "file-name", textContent: entry.file.name }),
    make("span", { textContent: `model ${entry.model}` }),
  );
  const { state } = entry;
  if (state.step === "failed") return [title, ...failure(state.error, actions)];
  if (state.step === "done") return [title, ...success(entry, state.answer, explains, evidence, actions)];
  const sending = state.step === "sending";
  const bar = make("progress", { max: 1, aria: { label: sending ? backend.verb : "Classification" } });
  if (sending) bar.value = state.share;
  const words = sending
    ? `${backend.verb} ${megabytes(state.bytes)} … ${Math.round(100 * state.share)} %`
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
  evidence: boolean,
  actions: Actions,
): HTMLElement[] {
  const shows = explains && evidence ? entry.label : null;
  return [
    ...verdict(answer),
    ...(entry.surer ? [surer(entry.surer, actions)] : []),
    bars(answer, entry, shows, actions, explains),
    ...(actions.search ? [alike(entry, actions.search)] : []),
    section("The mesh", ...describe(answer.mesh).map((text) => make("p", { textContent: text }))),
    times(answer),
    section("Take it with you", downloads(entry, explains, actions)),
  ];
}

function verdict(answer: Answer): HTMLElement[] {
  const [first, second] = answer.scores.map((score) => plain(score.class));
  const title = make("h2", { className: "verdict" });
  const words = make("p", { className: "confidence" });
  if (answer.unknown) {
    title.classList.add("unknown");
    title.textContent = "Unknown";
    words.textContent = `Unlike everything that ${answer.model.name} knows. The nearest class is ${first}.`;
  } else {
    title.textContent = isWeak(answer) && second ? `Probably ${first}, or ${second}` : first;
    words.textContent = isRough(answer)
      ? `These percentages are rough: ${answer.model.name} had too few examples to calibrate them. Teach it more.`
      : `${rightOf100(answer.probability)} of 100 answers like this are right.`;
  }
  return [title, words];
}

/** What another model says, which is surer. */
function surer(answer: Answer, actions: Actions): HTMLElement {
  const { name } = answer.model;
  return make(
    "p",
    { className: "surer" },
    make("span", {}, "The model ", make("strong", { textContent: name }), " is surer: "),
    make("strong", { textContent: plain(answer.class) }),
    ` (${rightOf100(answer.probability)} of 100 right). `,
    make("button", {
      type: "button",
      textContent: "Take its answer",
      onclick: () => actions.take(answer),
    }),
  );
}

function section(title: string, ...content: HTMLElement[]): HTMLElement {
  return make("section", {}, make("h3", { textContent: title }), ...content);
}

// Whether the times are unfolded.
let timesOpen = false;

function times(answer: Answer): HTMLElement {
  const summary = make("summary", { textContent: "Time" });
  const details = make("details", { open: timesOpen }, summary, timings(answer));
  details.ontoggle = () => (timesOpen = details.open);
  return details;
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
  const button = (form: Form, text: string) => {
    const made = make("button", { type: "button", textContent: text });
    made.onclick = async () => {
      made.textContent = "Preparing …";
      await actions.save(form);
      made.textContent = text;
    };
    return made;
  };
  if (explains) {
    row.append(button("glb", "Coloured mesh (GLB)"), button("ply", "PLY"));
    row.setAttribute("aria-label", `Evidence for ${plain(entry.label)}`);
    row.setAttribute("role", "group");
  }
  row.append(button("json", "JSON"));
  return row;
}
