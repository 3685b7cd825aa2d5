// The mesh as half-edges, as `model.topology.halfedges` has it: half-edge h = 3 f + s is side s of
// face f and runs from its corner s to corner (s + 1) mod 3; twin[h] is the half-edge on the other
// side, -1 on a border.

/** Half-edges sorted by (low vertex, high vertex, id). low, high: of each half-edge. */
export interface Edges {
  order: Int32Array;
  low: Int32Array;
  high: Int32Array;
}

export interface Twins {
  twin: Int32Array;
  border: number; // edges with one face
  nonmanifold: number; // edges with three faces or more, whose half-edges have no twin
}

export const faceOf = (h: number) => (h / 3) | 0;

export const nextSide = (h: number) => (h % 3 === 2 ? h - 2 : h + 1);

export const previousSide = (h: number) => (h % 3 === 0 ? h + 2 : h - 1);

export const ascends = (faces: Int32Array, h: number) => faces[h] < faces[nextSide(h)];

export const findTwins = (faces: Int32Array, vertexCount: number) => pairEdges(sortEdges(faces, vertexCount));

export function pairEdges(edges: Edges): Twins {
  const { order, low } = edges;
  const twin = new Int32Array(low.length).fill(-1);
  let border = 0;
  let nonmanifold = 0;
  for (let start = 0, end; start < order.length; start = end) {
    end = endOfEdge(edges, start);
    if (end - start === 1) border++;
    else if (end - start > 2) nonmanifold++;
    else pair(twin, order[start], order[start + 1]);
  }
  return { twin, border, nonmanifold };
}

/** Faces name no vertex twice. */
export function sortEdges(faces: Int32Array, vertexCount: number): Edges {
  const low = new Int32Array(faces.length);
  const high = new Int32Array(faces.length);
  for (let h = 0; h < faces.length; h++) {
    const [u, v] = [faces[h], faces[nextSide(h)]];
    low[h] = Math.min(u, v);
    high[h] = Math.max(u, v);
  }
  return { order: sortedBy([low, high], vertexCount), low, high };
}

/** Where the half-edges over the edge at `start` end. */
export function endOfEdge({ order, low, high }: Edges, start: number): number {
  let end = start + 1;
  while (
    end < order.length &&
    low[order[end]] === low[order[start]] &&
    high[order[end]] === high[order[start]]
  ) {
    end++;
  }
  return end;
}

/** Make two half-edges twins; where one is -1, the other is of a border. */
export function pair(twin: Int32Array, one: number, other: number): void {
  if (one >= 0) twin[one] = other;
  if (other >= 0) twin[other] = one;
}

/** 0, 1, ... in the order of keys below `keyCount`, the first of which decides before the others. */
export function sortedBy(keys: Int32Array[], keyCount: number): Int32Array {
  let order = new Int32Array(keys[0].length);
  for (let i = 0; i < order.length; i++) order[i] = i;
  for (const key of keys.toReversed()) order = countingSort(order, key, keyCount);
  return order;
}

/** Sort ids by their keys; ids of one key keep their order. */
function countingSort(ids: Int32Array, keys: Int32Array, keyCount: number): Int32Array<ArrayBuffer> {
  const places = new Uint32Array(keyCount + 1);
  for (let i = 0; i < ids.length; i++) places[keys[ids[i]] + 1]++;
  for (let key = 0; key < keyCount; key++) places[key + 1] += places[key];
  const result = new Int32Array(ids.length);
  for (let i = 0; i < ids.length; i++) result[places[keys[ids[i]]]++] = ids[i];
  return result;
}
