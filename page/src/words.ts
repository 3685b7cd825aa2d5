// What the service found, in plain words.

import type { Answer } from "./api";
import type { MeshReport } from "./preparation";
import type { Legend } from "./entries";

const whole = new Intl.NumberFormat("en", { useGrouping: true });

/** 12 040: thin spaces, which neither tongue takes for a decimal mark. */
export const count = (value: number) => whole.format(value).replaceAll(",", "\u202f");

const counted = (value: number, one: string, many = `${one}s`) =>
  `${count(value)} ${value === 1 ? one : many}`;

function percent(share: number): string {
  if (share > 0.999 && share < 1) return ">\u00a099.9\u00a0%";
  if (share < 0.001 && share > 0) return "<\u00a00.1\u00a0%";
  return `${(100 * share).toFixed(1)}\u00a0%`;
}

/** A probability that is fitted to nothing: "about 99 %". */
function roughly(share: number): string {
  const of100 = Math.min(99, Math.max(1, Math.round(100 * share)));
  return share < 0.005 ? "under 1\u00a0%" : `about ${of100}\u00a0%`;
}

/** The probability of a class in an answer, as exactly as it is known. */
export const probabilityIn = (answer: Answer, share: number) =>
  isRough(answer) ? roughly(share) : percent(share);

export function megabytes(bytes: number): string {
  if (bytes < 1e6) return `${Math.max(1, Math.round(bytes / 1e3))}\u00a0kB`;
  return `${Number((bytes / 1e6).toFixed(1))}\u00a0MB`;
}

/** "Score 0.04 = faces 0.06 − 0.02 bias": what is left of the two rounded numbers is the bias. */
export function sum({ score, bias }: Legend): string {
  const whole = Math.round(100 * score);
  const faces = Math.round(100 * (score - bias));
  const rest = whole - faces;
  const sign = rest < 0 ? "\u2212" : "+";
  return `Score ${decimal(whole)} = faces ${decimal(faces)} ${sign} ${decimal(Math.abs(rest))} bias`;
}

const decimal = (hundredths: number) => (hundredths / 100).toFixed(2).replace("-", "\u2212");

/** The name of a class, as one would write it. */
export const plain = (name: string) => name.replaceAll("_", " ");

// Below this probability, more than one answer in three is wrong.
const WEAK = 2 / 3;

export const isWeak = (answer: Answer) => Boolean(answer.unknown) || answer.probability < WEAK;

/** Whether its probabilities are rough: its model has no calibration. */
export const isRough = (answer: Answer) => answer.unknown === null;

/** How many of a hundred calibrated answers with this probability are right. */
export const rightOf100 = (probability: number) => Math.min(99, Math.round(100 * probability));

/** "snake, 99.6 %", "snake, about 99 %" or "unknown", for lists and screen readers. */
export function verdict(answer: Answer): string {
  if (answer.unknown) return "unknown";
  return `${plain(answer.class)}, ${probabilityIn(answer, answer.probability)}`;
}

/** The first sentence says what the mesh is like; the others, what was done to it. */
export function describe(mesh: MeshReport): string[] {
  const surface = mesh.watertight ? "Closed" : `Open (${counted(mesh.border_edges, "border edge")})`;
  const parts = mesh.components === 1 ? "in one piece" : `in ${count(mesh.components)} pieces`;
  const sentences = [`${surface}, ${parts}, ${faces(mesh)}.`];
  const did: [number, string][] = [
    [mesh.vertices_merged, `merged ${counted(mesh.vertices_merged, "coinciding vertex", "coinciding vertices")}`],
    [mesh.degenerate_dropped, `dropped ${counted(mesh.degenerate_dropped, "face")} without area`],
    [mesh.duplicates_dropped, `dropped ${counted(mesh.duplicates_dropped, "duplicate face")}`],
    [mesh.nonmanifold_edges, `cut ${counted(mesh.nonmanifold_edges, "edge")} with more than two faces`],
    [mesh.flipped, `turned ${counted(mesh.flipped, "face")} the right way out`],
    [mesh.components_lost, `lost ${counted(mesh.components_lost, "small piece")}`],
  ];
  const done = did.filter(([number]) => number > 0).map(([, words]) => words);
  if (done.length) sentences.push(`On the way we ${listed(done)}.`);
  if (Math.abs(mesh.area_kept - 1) > 0.05) {
    sentences.push(`Simplifying changed the surface to ${Math.round(100 * mesh.area_kept)} % of its area.`);
  }
  if (!mesh.within_budget) sentences.push("It has so many pieces that it could not be made simpler.");
  return sentences;
}

function faces(mesh: MeshReport): string {
  const all = counted(mesh.faces_in, "face");
  if (mesh.resampled === "decimated") return `${all}, simplified to ${count(mesh.faces_used)}`;
  if (mesh.resampled === "subdivided") return `${all}, divided into ${count(mesh.faces_used)}`;
  return all;
}

const MOST_NAMES = 3;

/** "1 file passed over: notes.txt", or nothing for none. */
export function passedOverIn(names: string[]): string {
  if (!names.length) return "";
  const some = names.slice(0, MOST_NAMES).join(", ") + (names.length > MOST_NAMES ? ", …" : "");
  return `${counted(names.length, "file")} passed over: ${some}`;
}

const listed = (items: string[]) => new Intl.ListFormat("en").format(items);
