// Fewer triangles for the view: corners in one cell of a grid become one, and triangles that
// this makes lines or points go.

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
    low[i % 3] = Math.min(low[i % 3], positions[i]);
    high[i % 3] = Math.max(high[i % 3], positions[i]);
  }
  const step = Math.max(...high.map((value, k) => value - low[k])) / cells;
  const cellOf = new Float64Array(positions.length / 3);
  const first = new Map<number, number>();
  for (let v = 0; v < cellOf.length; v++) {
    let cell = 0;
    for (let k = 0; k < 3; k++) {
      cell = cell * (cells + 1) + Math.floor((positions[3 * v + k] - low[k]) / step);
    }
    cellOf[v] = cell;
    if (!first.has(cell)) first.set(cell, v);
  }
  const kept: number[] = [];
  for (let f = 0; f < positions.length / 9; f++) {
    const [a, b, c] = [cellOf[3 * f], cellOf[3 * f + 1], cellOf[3 * f + 2]];
    if (a !== b && b !== c && c !== a) kept.push(f);
  }
  const fewer = new Float64Array(9 * kept.length);
  const fewerColours = colours && new Float32Array(3 * kept.length);
  kept.forEach((f, i) => {
    for (let s = 0; s < 3; s++) {
      const from = 3 * first.get(cellOf[3 * f + s])!;
      fewer.set(positions.subarray(from, from + 3), 9 * i + 3 * s);
    }
    fewerColours?.set(colours!.subarray(3 * f, 3 * f + 3), 3 * i);
  });
  return { positions: fewer, colours: fewerColours };
}
