// The stage: the view, and what stands around the mesh in it.

import { byId, isPressed } from "./dom";
import type { Entry, Legend } from "./entries";
import type { Shown } from "./parsing";
import { Viewer } from "./viewer";
import { count, plain, sum } from "./words";

const canvas = byId<HTMLCanvasElement>("view");
const spin = byId<HTMLButtonElement>("spin");
const wires = byId<HTMLButtonElement>("wires");
const upright = byId<HTMLButtonElement>("upright");
const toggle = byId<HTMLButtonElement>("evidence");

export class Stage {
  private readonly viewer: Viewer | null;
  /** What the view has now. */
  private drawn: { entry: Entry; shown: Shown; zUp: boolean } | null = null;

  constructor(turnUpright: () => void) {
    this.viewer = viewerOn(canvas);
    spin.onclick = () => this.spin(!isPressed(spin));
    wires.onclick = () => this.wires(!isPressed(wires));
    byId("reset").onclick = () => this.viewer?.reset();
    upright.onclick = turnUpright;
    if (this.viewer) this.viewer.onTouched = () => this.spin(false);
    this.spin(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  }

  /** entry: null for none. evidence: whether it is to be shown; null where there can be none.
   * showEvidence: what the control for it does. */
  show(entry: Entry | null, evidence: boolean | null, showEvidence: (on: boolean) => void): void {
    const answered = entry?.answer ? entry : null;
    const explained = answered && evidence ? answered.explained.get(answered.label) : undefined;
    // The colours of before stay until others are there.
    const waits = Boolean(entry && evidence && entry.explaining && this.drawn?.entry === entry);
    const shown = explained?.shown ?? (waits ? this.drawn!.shown : (entry?.shown ?? null));
    byId("empty").hidden = Boolean(entry);
    canvas.hidden = byId("tools").hidden = !this.viewer || !shown;
    this.draw(entry, shown);
    this.note(entry, shown);
    const strip = byId("strip");
    strip.hidden = !answered || evidence === null || !shown;
    if (answered && evidence !== null) describe(answered, evidence, explained?.legend);
    toggle.onclick = () => showEvidence(toggle.dataset.does === "show");
    if (!entry) return;
    upright.setAttribute("aria-pressed", String(entry.zUp));
    if (waits && !explained) return;
    const look = explained ? `evidence for ${plain(entry.label)} in colours` : "in grey";
    canvas.setAttribute("aria-label", `${entry.file.name} in 3D, ${look}`);
    canvas.dataset.shows = explained ? entry.label : shown ? "mesh" : "nothing";
  }

  private draw(entry: Entry | null, shown: Shown | null): void {
    if (!entry || !shown) {
      this.drawn = null;
      this.viewer?.clear();
      return;
    }
    const { zUp } = entry;
    if (shown === this.drawn?.shown && zUp === this.drawn.zUp) return;
    this.drawn = { entry, shown, zUp };
    this.viewer?.show(shown, zUp);
  }

  private note(entry: Entry | null, shown: Shown | null): void {
    const note = byId("view-note");
    note.classList.toggle("alone", !shown || !this.viewer);
    note.textContent = entry && this.words(entry, shown);
    note.hidden = !note.textContent;
  }

  private words(entry: Entry, shown: Shown | null): string {
    if (!this.viewer) return "This browser shows no 3D: WebGL is off. The result does without.";
    if (!shown) return entry.unreadable && !entry.explaining ? "There is nothing to draw" : "Reading …";
    const faces = shown.positions.length / 9;
    return faces < shown.faces ? `Drawn with ${count(faces)} of ${count(shown.faces)} faces` : "";
  }

  private spin(on: boolean): void {
    spin.setAttribute("aria-pressed", String(on));
    if (this.viewer) this.viewer.spinning = on;
  }

  private wires(on: boolean): void {
    wires.setAttribute("aria-pressed", String(on));
    if (this.viewer) this.viewer.wireframe = on;
  }
}

function viewerOn(element: HTMLCanvasElement): Viewer | null {
  try {
    return new Viewer(element);
  } catch {
    return null; // no WebGL
  }
}

/** The strip below the view: what the colours mean, and the control that shows and hides them. */
function describe(entry: Entry, evidence: boolean, legend: Legend | undefined): void {
  const label = plain(entry.label);
  const error = evidence && !legend && !entry.explaining ? entry.explainError : null;
  const computing = evidence && !legend && !error;
  byId("legend").hidden = !legend;
  byId("computing").hidden = !computing;
  byId("strip-title").textContent = error
    ? error.message
    : computing
      ? `Finding what speaks for ${label} …`
      : `What speaks for ${label}`;
  toggle.dataset.does = error || !evidence ? "show" : "hide";
  toggle.textContent = error ? "Try again" : !evidence ? "Show" : computing ? "Cancel" : "Hide";
  if (!legend) return;
  byId("legend-scale").style.background = `linear-gradient(90deg, ${legend.colours.join(", ")})`;
  byId("legend-sum").textContent = sum(legend);
}
