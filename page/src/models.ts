// The menu of models: what each knows. The choice is kept for later visits, and stands in the URL.

import type { Model } from "./api";
import { byId, make } from "./dom";
import { count, megabytes, plain } from "./words";

const NAME = "meshconv3d-model";
const EXAMPLES = 8;

export class ModelMenu {
  /** The name of the model that is asked. */
  chosen = "";
  private readonly menu = byId("models");

  constructor(private readonly changed: () => void) {}

  fill(models: Model[]): void {
    const names = models.map(({ name }) => name);
    const wanted = new URLSearchParams(location.search).get("model") ?? localStorage.getItem(NAME);
    this.chosen = names.includes(wanted!) ? wanted! : names[0];
    this.menu.replaceChildren(...models.map((model) => make("li", {}, this.row(model))));
    byId("model").hidden = false;
    this.mark();
  }

  private row(model: Model): HTMLElement {
    const row = make(
      "button",
      { type: "button", className: "model-row", onclick: () => this.choose(model.name) },
      make("strong", { textContent: model.name }),
      make("span", { className: "quiet", textContent: figures(model) + size(model) }),
      make("span", { textContent: examples(model.config.classes) }),
    );
    row.dataset.model = model.name;
    return row;
  }

  private choose(name: string): void {
    this.menu.hidePopover();
    if (name === this.chosen) return;
    this.chosen = name;
    localStorage.setItem(NAME, name);
    const url = new URL(location.href);
    url.searchParams.set("model", name);
    history.replaceState(null, "", url);
    this.mark();
    this.changed();
  }

  private mark(): void {
    byId("model-name").textContent = this.chosen;
    for (const row of this.menu.querySelectorAll<HTMLElement>("button")) {
      row.setAttribute("aria-current", String(row.dataset.model === this.chosen));
    }
  }
}

/** "80 classes, 77 of 100 test meshes right" */
function figures({ config, accuracy, calibration, training }: Model): string {
  const classes = `${count(config.classes.length)} classes`;
  const { test, left_out: leftOut } = accuracy;
  const of100 = (share: number) => `${Math.round(100 * share)} of 100`;
  const taught = training?.taught && Object.values(training.taught.examples);
  if (taught) {
    const sum = taught.reduce((total, number) => total + number, 0);
    const right = leftOut === undefined ? "" : `, ${of100(leftOut)} right when left out`;
    const rough = calibration ? "" : ", rough percentages";
    return `${classes}, taught from ${count(sum)} examples${right}${rough}`;
  }
  return test === undefined ? classes : `${classes}, ${of100(test)} test meshes right`;
}

/** ", 3.7 MB" of a model that this browser has to load. */
const size = ({ bytes }: Model) => (bytes === undefined ? "" : `, ${megabytes(bytes)}`);

/** Some class names, from all over the alphabet. */
function examples(classes: string[]): string {
  const step = Math.max(1, classes.length / EXAMPLES);
  const some = classes.filter((_, i) => Math.floor(i / step) > Math.floor((i - 1) / step));
  return some.map(plain).join(", ") + (some.length < classes.length ? ", …" : "");
}
