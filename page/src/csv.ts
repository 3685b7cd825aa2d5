// The gallery as a table, with columns that the command line's CSV has, too.

import type { Entry } from "./entries";

const COLUMNS: Record<string, (entry: Entry) => string | number | boolean | null | undefined> = {
  file: ({ file }) => file.name,
  class: ({ answer }) => answer?.class,
  probability: ({ answer }) => answer?.probability,
  unknown: ({ answer }) => answer?.unknown,
  "error.message": ({ state }) => (state.step === "failed" ? state.error.message : null),
  "model.name": ({ answer }) => answer?.model.name,
  "model.sha256": ({ answer }) => answer?.model.sha256,
  "mesh.faces_in": ({ answer }) => answer?.mesh.faces_in,
};

export function csvOf(entries: Entry[]): string {
  const rows = entries.map((entry) => Object.values(COLUMNS).map((value) => cell(value(entry) ?? "")));
  return [Object.keys(COLUMNS), ...rows].map((row) => `${row.join(",")}\n`).join("");
}

/** An apostrophe precedes text that a spreadsheet would take for a formula. */
function cell(value: string | number | boolean): string {
  if (typeof value !== "string") return String(value);
  const text = /^[=+\-@\t\r\n]/.test(value) ? `'${value}` : value;
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
