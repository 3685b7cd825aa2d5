// Simplification by quadric edge collapse, as `model.preparation.simplification` does it: edges wait
// in buckets, by the logarithm of their cost, and are measured again when their turn comes.

import type { Mesh } from "../mesh";
import { dropUnused } from "./cleaning";
import {
  around,
  collapseEdge,
  DEGENERATE,
  effectOfMoving,
  halfEdges,
  meetsLinkCondition,
  TURNED,
  type HalfEdges,
} from "./edge-collapse";
import { row, write, type Vector } from "./geometry";
import { faceOf, nextSide, previousSide } from "./halfedges";
import { leastPoint, NUMBERS, vertexQuadrics } from "./quadrics";

// A collapse that turns a face over waits until others cost this many times as much.
const TURN_COST = 10;
// Faces around both ends up to which an edge is collapsed.
const MOST_FACES_AROUND = 256;
// How many of the last bits of a cost, a float32, its bucket leaves out, above and below MANY_BUDGETS.
const FINE = 21;
const COARSE = 26;
const MANY_BUDGETS = 20;
const BUCKETS = 2 ** 10;
// When every edge has had its turn, all have another if that removed this share of the excess.
const LEAST_PROGRESS = 1 / 4;

/** Simplify an oriented manifold of more than `budget` faces. More are left where no collapse is
 * allowed any more. origin: which of the faces given each one was. */
export function simplify(given: Mesh, twin: Int32Array, budget: number): Mesh & { origin: number[] } {
  const mesh = halfEdges(given, twin);
  const quadrics = vertexQuadrics(given, twin);
  let living = given.faces.length / 3;
  if (living > 2 * MANY_BUDGETS * budget) {
    living = collapseEdges(mesh, quadrics, living, MANY_BUDGETS * budget, COARSE);
  }
  collapseEdges(mesh, quadrics, living, budget, FINE);
  const origin: number[] = [];
  for (let h = 0; h < mesh.start.length; h += 3) if (mesh.start[h] >= 0) origin.push(faceOf(h));
  const left = origin.flatMap((f) => [...mesh.start.subarray(3 * f, 3 * f + 3)]);
  return { ...dropUnused(mesh.vertices, Int32Array.from(left)), origin };
}

const END = -1;
const ABSENT = -2;

/** Half-edges in buckets, first in, first out. after: the one behind each, END or ABSENT. */
class Queue {
  readonly after: Int32Array;
  private readonly head = new Int32Array(BUCKETS).fill(END);
  private readonly tail = new Int32Array(BUCKETS);
  private readonly cost = new Float32Array(1);
  private readonly bits = new Int32Array(this.cost.buffer);

  /** shift: FINE or COARSE. */
  constructor(
    halfEdges: number,
    private readonly shift: number,
  ) {
    this.after = new Int32Array(halfEdges).fill(ABSENT);
  }

  bucket(cost: number): number {
    this.cost[0] = cost;
    return this.bits[0] >> this.shift;
  }

  push(h: number, bucket: number): void {
    this.after[h] = END;
    if (this.head[bucket] === END) this.head[bucket] = h;
    else this.after[this.tail[bucket]] = h;
    this.tail[bucket] = h;
  }

  isEmpty = (bucket: number) => this.head[bucket] === END;

  pop(bucket: number): number {
    const h = this.head[bucket];
    this.head[bucket] = this.after[h];
    this.after[h] = ABSENT;
    return h;
  }
}

/** Collapse edges of a mesh of `living` faces until `budget` are left or none is allowed. Returns how
 * many are left. */
function collapseEdges(
  mesh: HalfEdges,
  quadrics: Float64Array,
  living: number,
  budget: number,
  shift: number,
): number {
  const queue = new Queue(mesh.twin.length, shift);
  // For each vertex, the number of the last attempt that met it.
  const met = new Int32Array(mesh.valence.length);
  let attempt = 0;
  let excess = 0;
  let current = BUCKETS;
  while (living > budget) {
    while (current < BUCKETS && queue.isEmpty(current)) current++;
    if (current === BUCKETS) {
      if (excess > 0 && living - budget > (1 - LEAST_PROGRESS) * excess) break;
      excess = living - budget;
      pushAllEdges(mesh, quadrics, queue);
      current = 0;
      continue;
    }
    const h = queue.pop(current);
    if (mesh.start[h] < 0) continue;
    const [u, v] = [mesh.start[h], mesh.start[nextSide(h)]];
    if (mesh.valence[u] + mesh.valence[v] > MOST_FACES_AROUND) continue;
    const [place, cost] = leastPointOf(mesh, quadrics, u, v);
    if (queue.bucket(cost) > current) {
      queue.push(h, queue.bucket(cost));
      continue;
    }
    if (!meetsLinkCondition(mesh, h, u, v, met, ++attempt)) continue;
    const effect = Math.max(effectOfMoving(mesh, u, v, place), effectOfMoving(mesh, v, u, place));
    if (effect === DEGENERATE) continue;
    if (effect === TURNED && queue.bucket(TURN_COST * cost) > current) {
      queue.push(h, queue.bucket(TURN_COST * cost));
      continue;
    }
    living -= collapseEdge(mesh, h, u, v);
    write(mesh.vertices, u, place);
    for (let i = 0; i < NUMBERS; i++) quadrics[NUMBERS * u + i] += quadrics[NUMBERS * v + i];
    pushEdgesAround(mesh, queue, u, current);
  }
  return living;
}

const leastPointOf = (mesh: HalfEdges, quadrics: Float64Array, u: number, v: number): [Vector, number] =>
  leastPoint(quadrics, u, v, row(mesh.vertices, u), row(mesh.vertices, v));

/** Queue every edge, by the later of its half-edges. */
function pushAllEdges(mesh: HalfEdges, quadrics: Float64Array, queue: Queue): void {
  for (let h = 0; h < mesh.twin.length; h++) {
    if (mesh.twin[h] > h || mesh.start[h] < 0) continue;
    const [, cost] = leastPointOf(mesh, quadrics, mesh.start[h], mesh.start[nextSide(h)]);
    queue.push(h, queue.bucket(cost));
  }
}

/** Queue the edges at a vertex that are not in the queue: they may be allowed now. */
function pushEdgesAround(mesh: HalfEdges, queue: Queue, u: number, bucket: number): void {
  let last = -1;
  for (const g of around(mesh, u)) {
    const t = mesh.twin[g];
    if (queue.after[g] === ABSENT && (t < 0 || queue.after[t] === ABSENT)) queue.push(g, bucket);
    last = previousSide(g);
  }
  if (mesh.twin[last] < 0 && queue.after[last] === ABSENT) queue.push(last, bucket);
}
