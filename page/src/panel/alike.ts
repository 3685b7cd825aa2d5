// More like this: meshes of the library, as pictures.

import type { Alike } from "../api";
import { make } from "../dom";
import type { Entry } from "../entries";
import { picture } from "../shelf";
import { plain } from "../words";

// Where a mesh is said to be the same shape, whatever its triangles.
const SAME = 0.85;

export function alike(entry: Entry, search: () => void): HTMLElement {
  const box = make("section", {}, make("h3", { textContent: "More like this" }));
  if (entry.similar) {
    const same = entry.similar.filter(isSame);
    const others = entry.similar.filter((found) => !isSame(found));
    if (same.length) box.append(make("p", { textContent: "The same shape is there already:" }), cards(same));
    if (others.length) box.append(make("p", { textContent: "The most like it:" }), cards(others));
    return box;
  }
  const failed = entry.searchError;
  if (failed) box.append(make("p", { className: "reason", textContent: failed.message }));
  const button = make("button", {
    type: "button",
    textContent: entry.searching ? "Searching …" : failed ? "Try again" : "Search the library",
    disabled: entry.searching,
    onclick: search,
  });
  box.append(button);
  return box;
}

const isSame = (found: Alike) => (found.same_shape ?? 0) >= SAME;

const cards = (found: Alike[]) => make("ul", { className: "alike" }, ...found.map(card));

function card(found: Alike): HTMLElement {
  const name = found.file.split("/").pop()!;
  return make(
    "li",
    { title: found.file },
    make(
      "span",
      { className: "card" },
      picture(found.picture),
      make("span", { className: "card-name", textContent: name }),
      make("span", {
        className: "card-verdict",
        textContent: found.unknown ? "unknown" : plain(found.class),
      }),
    ),
  );
}
