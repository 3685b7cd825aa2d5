// The outer shell of a mesh that has walls inside, as `model.preparation.shell` finds it: a walker on
// one side of a face crosses each of its edges to the side of the next face around that edge. Faces
// that look outside on neither side are walls.

import { corners, cross, dot, row, subtract, type Vector } from "./geometry";
import { ascends, endOfEdge, faceOf, nextSide, previousSide, type Edges } from "./halfedges";

/** Faces (1) that are enclosed by others of their component. A component that can be entered through
 * a border has none. */
export function findWalls(vertices: Float64Array, faces: Int32Array, edges: Edges): Uint8Array {
  const { component, isOpen } = componentsOf(faces.length / 3, edges);
  if (isOpen.every(Boolean)) return new Uint8Array(isOpen.length);
  const side = Int32Array.from({ length: 2 * isOpen.length }, (_, i) => i);
  for (let start = 0, end; start < edges.order.length; start = end) {
    end = endOfEdge(edges, start);
    if (isOpen[faceOf(edges.order[start])]) continue;
    let around = [...edges.order.subarray(start, end)];
    if (around.length > 2) {
      const angles = anglesOf(vertices, faces, around);
      around = around
        .map((_, i) => i)
        .sort((i, j) => angles[i] - angles[j])
        .map((i) => around[i]);
    }
    around.forEach((h, i) => joinSides(side, faces, h, around[(i + 1) % around.length]));
  }
  for (let i = 0; i < side.length; i++) side[i] = findRoot(side, i);
  return lookAtNoOutside(vertices, faces, side, component, isOpen);
}

/** The first face of each face's component, and whether that has a border. */
function componentsOf(count: number, edges: Edges) {
  const component = Int32Array.from({ length: count }, (_, f) => f);
  const isOpen = new Uint8Array(count);
  const { order } = edges;
  for (let start = 0, end; start < order.length; start = end) {
    end = endOfEdge(edges, start);
    if (end - start === 1) isOpen[faceOf(order[start])] = 1;
    for (let i = start + 1; i < end; i++) join(component, faceOf(order[i - 1]), faceOf(order[i]));
  }
  for (let f = 0; f < count; f++) {
    component[f] = findRoot(component, f);
    isOpen[component[f]] |= isOpen[f];
  }
  for (let f = 0; f < count; f++) isOpen[f] = isOpen[component[f]];
  return { component, isOpen };
}

/** Join the side of h that looks along the turn, and that of the next that looks against it. */
function joinSides(side: Int32Array, faces: Int32Array, h: number, next: number): void {
  join(side, 2 * faceOf(h) + (ascends(faces, h) ? 0 : 1), 2 * faceOf(next) + (ascends(faces, next) ? 1 : 0));
}

/** Angle of each face around the edge that all share, from the first, seen along the edge. */
function anglesOf(vertices: Float64Array, faces: Int32Array, around: number[]): number[] {
  const [u, v] = [faces[around[0]], faces[nextSide(around[0])]];
  const origin = row(vertices, Math.min(u, v));
  const axis = subtract(row(vertices, Math.max(u, v)), origin);
  // Across the edge, at a right angle to it: the direction of a face turned by one about the axis.
  const across = around.map((h) => cross(axis, subtract(row(vertices, faces[previousSide(h)]), origin)));
  const yAxis = across[0];
  const xAxis: Vector = cross(yAxis, axis);
  // y has the scale of the axis more than x.
  const scale = Math.sqrt(dot(axis, axis));
  return across.map((a) => Math.atan2(-dot(a, xAxis), dot(a, yAxis) * scale));
}

/** Which faces of closed components look at no outside. side: the cell that the front and the back of
 * each face look at. The outside of a component is, of the cells as long, wide and high as itself,
 * the one that spans the largest volume: inside is negative. */
function lookAtNoOutside(
  vertices: Float64Array,
  faces: Int32Array,
  side: Int32Array,
  component: Int32Array,
  isOpen: Uint8Array,
): Uint8Array {
  const volumes = new Float64Array(side.length);
  const cells = new Boxes(side.length);
  const parts = new Boxes(component.length);
  for (let f = 0; f < component.length; f++) {
    if (isOpen[f]) continue;
    const [a, b, c] = corners(vertices, faces, f);
    const volume = dot(a, cross(b, c));
    const [front, back] = [side[2 * f], side[2 * f + 1]];
    volumes[front] += volume;
    volumes[back] -= volume;
    for (const corner of [a, b, c]) {
      cells.extend(front, corner);
      cells.extend(back, corner);
      parts.extend(component[f], corner);
    }
  }
  const outside = new Int32Array(component.length).fill(-1);
  for (let cell = 0; cell < side.length; cell++) {
    const part = component[cell >> 1];
    const spans = side[cell] === cell && !isOpen[part] && cells.areSame(cell, parts, part);
    if (spans && (outside[part] < 0 || volumes[cell] > volumes[outside[part]])) outside[part] = cell;
  }
  const leaks = isOpen.slice();
  component.forEach((part, f) => {
    if (side[2 * f] === outside[part] && side[2 * f + 1] === outside[part]) leaks[part] = 1;
  });
  return Uint8Array.from(component, (part, f) => {
    const out = outside[part];
    return Number(!leaks[part] && side[2 * f] !== out && side[2 * f + 1] !== out);
  });
}

/** Boxes around points. */
class Boxes {
  private readonly low: Float64Array;
  private readonly high: Float64Array;

  constructor(count: number) {
    this.low = new Float64Array(3 * count).fill(Infinity);
    this.high = new Float64Array(3 * count).fill(-Infinity);
  }

  extend(box: number, point: Vector): void {
    for (let k = 0; k < 3; k++) {
      const i = 3 * box + k;
      if (point[k] < this.low[i]) this.low[i] = point[k];
      if (point[k] > this.high[i]) this.high[i] = point[k];
    }
  }

  areSame(box: number, others: Boxes, other: number): boolean {
    return [0, 1, 2].every((k) => {
      const [i, j] = [3 * box + k, 3 * other + k];
      return this.low[i] === others.low[j] && this.high[i] === others.high[j];
    });
  }
}

/** Union-find: make one set of those of a and b, whose root is the least of its members. */
function join(parent: Int32Array, a: number, b: number): void {
  [a, b] = [findRoot(parent, a), findRoot(parent, b)];
  parent[Math.max(a, b)] = Math.min(a, b);
}

function findRoot(parent: Int32Array, node: number): number {
  while (parent[node] !== node) {
    parent[node] = parent[parent[node]];
    node = parent[node];
  }
  return node;
}
