// Fewer triangles for the view: corners in one cell of a grid become one, and triangles that
// this makes lines or points go.

import { firstEqual } from "./equal";
import type { Soup } from "./soup";

/** What a view turns smoothly, on a phone too. */
export const MOST_FACES = 150_000;

const FINEST = 512;

export function reduced(soup: Soup, most = MOST_FACES): Soup {
  let { positions, colours } = soup;
  for (let cells = FINEST; positions.length / 9 > most && cells > 8; cells = Math.floor(cells / 1.4)) {
    ({ positions, colours } = clustered(soup, cells));
  }
  return { positions, colours };
}

function clustered({ positions, colours }: Soup, cells: number): Soup {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < positions.length; i++) {
    if (positions[i] < low[i % 3]) low[i % 3] = positions[i];
    if (positions[i] > high[i % 3]) high[i % 3] = positions[i];
  }
  const step = Math.max(...high.map((value, k) => value - low[k])) / cells;
  const cellOf = new Int32Array(positions.length / 3); // less than 2 ** 31, as FINEST ** 3 is
  for (let v = 0; v < cellOf.length; v++) {
    for (let k = 0; k < 3; k++) {
      const along = Math.floor((positions[3 * v + k] - low[k]) / step);
      cellOf[v] = (cells + 1) * cellOf[v] + along;
    }
  }
  const first = firstEqual(cellOf, 1);
  const isKept = (f: number) => {
    const [a, b, c] = [first[3 * f], first[3 * f + 1], first[3 * f + 2]];
    return a !== b && b !== c && c !== a;
  };
  let count = 0;
  for (let f = 0; f < first.length / 3; f++) count += Number(isKept(f));
  const fewer = new Float64Array(9 * count);
  const fewerColours = colours && new Float32Array(3 * count);
  for (let f = 0, i = 0; i < count; f++) {
    if (!isKept(f)) continue;
    for (let s = 0; s < 9; s++) fewer[9 * i + s] = positions[3 * first[3 * f + Math.floor(s / 3)] + (s % 3)];
    for (let k = 0; fewerColours && k < 3; k++) fewerColours[3 * i + k] = colours![3 * f + k];
    i++;
  }
  return { positions: fewer, colours: fewerColours };
}
