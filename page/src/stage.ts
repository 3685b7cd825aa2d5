// The stage: the view, and what stands around the mesh in it.

import { byId } from "./dom";
import type { Entry, Legend } from "./entries";
import type { Shown } from "./parsing";
import { Viewer } from "./viewer";
import { count, plain, signed } from "./words";

const canvas = byId<HTMLCanvasElement>("view");
const spin = byId<HTMLButtonElement>("spin");
const upright = byId<HTMLButtonElement>("upright");

export class Stage {
  private readonly viewer: Viewer | null;
  /** What the view has now. */
  private drawn: { shown: Shown; zUp: boolean } | null = null;

  constructor(turnUpright: () => void) {
    this.viewer = viewerOn(canvas);
    spin.onclick = () => this.spin(spin.getAttribute("aria-pressed") !== "true");
    byId("reset").onclick = () => this.viewer?.reset();
    upright.onclick = turnUpright;
    if (this.viewer) this.viewer.onTouched = () => this.spin(false);
    this.spin(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  }

  /** explains: whether there can be evidence to show. */
  show(entry: Entry, explains: boolean): void {
    const explained = entry.chosen ? entry.explained.get(entry.chosen) : undefined;
    const shown = explained?.shown ?? entry.shown;
    byId("empty").hidden = true;
    canvas.hidden = byId("tools").hidden = !this.viewer || !shown;
    this.draw(shown, entry.zUp);
    upright.setAttribute("aria-pressed", String(entry.zUp));
    const look = entry.chosen ? `evidence for ${plain(entry.chosen)} in colours` : "in grey";
    canvas.setAttribute("aria-label", `${entry.file.name} in 3D, ${look}`);
    canvas.dataset.shows = shown ? (entry.chosen ?? "mesh") : "nothing";
    this.note(entry, shown);
    showLegend(explained?.legend);
    byId("hint").hidden = !entry.answer || !explains || Boolean(explained);
  }

  private draw(shown: Shown | null, zUp: boolean): void {
    if (shown === (this.drawn?.shown ?? null) && zUp === this.drawn?.zUp) return;
    this.drawn = shown && { shown, zUp };
    if (shown) this.viewer?.show(shown, zUp);
    else this.viewer?.clear();
  }

  private note(entry: Entry, shown: Shown | null): void {
    const note = byId("view-note");
    note.classList.toggle("alone", !shown || !this.viewer);
    note.textContent = this.words(entry, shown);
    note.hidden = !note.textContent;
  }

  private words(entry: Entry, shown: Shown | null): string {
    if (!this.viewer) return "This browser shows no 3D: WebGL is off. The result does without.";
    if (!shown) return entry.unreadable ? "There is nothing to draw" : "Reading …";
    const faces = shown.positions.length / 9;
    return faces < shown.faces ? `Drawn with ${count(faces)} of ${count(shown.faces)} faces` : "";
  }

  private spin(on: boolean): void {
    spin.setAttribute("aria-pressed", String(on));
    if (this.viewer) this.viewer.spinning = on;
  }
}

function viewerOn(element: HTMLCanvasElement): Viewer | null {
  try {
    return new Viewer(element);
  } catch {
    return null; // no WebGL
  }
}

function showLegend(legend: Legend | undefined): void {
  byId("legend").hidden = !legend;
  if (!legend) return;
  byId("legend-title").textContent = `What speaks for ${plain(legend.class)}`;
  byId("legend-scale").style.background = `linear-gradient(90deg, ${legend.colours.join(", ")})`;
  const faces = legend.score - legend.bias;
  byId("legend-sum").textContent =
    `Score ${legend.score.toFixed(2)} = faces ${faces.toFixed(2)} ${signed(legend.bias)} bias`;
}
