// Meshes of the library that are most like one, as `service.library` finds them.

import type { Alike, Calibration } from "../api";
import { logistic, rounded } from "./prediction";

/** A mesh of the library. picture: address of one, relative to the page. */
export interface LibraryEntry {
  file: string;
  class: string;
  unknown: boolean | null;
  picture: string | null;
}

const MOST = 10;
const LEAST_DISTANCE = 0.01;

/** The most alike first. embeddings: those of the entries, one after another, of unit length. */
export function nearest(
  embedding: Float32Array,
  embeddings: Float32Array,
  entries: LibraryEntry[],
  calibration: Calibration | null,
): Alike[] {
  const length = embedding.length;
  const cosines = entries.map((_, row) => {
    let sum = 0;
    for (let i = 0; i < length; i++) sum += embedding[i] * embeddings[row * length + i];
    return sum;
  });
  const rows = entries.map((_, row) => row).sort((a, b) => cosines[b] - cosines[a]);
  return rows.slice(0, MOST).map((row) => {
    const distance = Math.sqrt(Math.max(2 - 2 * cosines[row], 0));
    return {
      ...entries[row],
      distance: rounded(distance, 5),
      same_shape: sameShape(distance, calibration),
    };
  });
}

function sameShape(distance: number, calibration: Calibration | null): number | null {
  if (!calibration?.same_shape) return null;
  const [factor, constant] = calibration.same_shape;
  return rounded(logistic(factor * Math.log(distance + LEAST_DISTANCE) + constant), 5);
}
