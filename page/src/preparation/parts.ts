// Parts of a mesh, which share no edge: dust, and those that a face budget has room for, as
// `model.preparation.parts` decides.

import { dropUnused, type CleanSurface } from "./cleaning";
import { faceAreas, sum } from "./geometry";
import { faceOf } from "./halfedges";

// A part is dust when its area is less than this share of a mean face's at the budget, and all dust
// together is at most DUST_SHARE of the surface.
const DUST = 0.25;
const DUST_SHARE = 0.01;
// A part of fewer faces is a scrap: a leaf, a blade of grass.
const SCRAP_FACES = 4;

/** Drop the smallest parts, if they are dust. */
export function dropDust(surface: CleanSurface, budget: number): CleanSurface {
  if (surface.counts.components === 1) return surface;
  const areas = partAreas(surface);
  const ascending = sortedPlaces(areas);
  const total = sum(areas.map((_, i) => areas[ascending[i]]));
  const kept = new Uint8Array(areas.length).fill(1);
  let cumulated = 0;
  for (const part of ascending) {
    cumulated += areas[part];
    if (areas[part] < (DUST * total) / budget && cumulated <= DUST_SHARE * total) kept[part] = 0;
  }
  return kept.every(Boolean) ? surface : keepParts(surface, kept);
}

/** Which parts to keep so that `budget` faces do: those with most area for each face. sizes: the
 * least faces that each can be simplified to. A part with more area than all that fit is kept alone,
 * even where it does not fit. */
export function fittingParts(areas: Float64Array, sizes: Int32Array, budget: number): Uint8Array {
  const kept = new Uint8Array(areas.length);
  const least = sizes.reduce((a, b) => Math.min(a, b));
  for (const part of sortedPlaces(areas.map((area, i) => -area / sizes[i]))) {
    if (sizes[part] <= budget) {
      kept[part] = 1;
      budget -= sizes[part];
    }
    if (budget < least) break;
  }
  const largest = areas.indexOf(areas.reduce((a, b) => Math.max(a, b)));
  return areas[largest] > sum(areas.filter((_, i) => kept[i]))
    ? kept.map((_, i) => Number(i === largest))
    : kept;
}

/** Area of all scraps. */
export function scrapArea(surface: CleanSurface): number {
  const sizes = partSizes(surface.component, surface.counts.components);
  return sum(partAreas(surface).filter((_, part) => sizes[part] < SCRAP_FACES));
}

/** Area of each part. */
export function partAreas({ vertices, faces, component, counts }: CleanSurface): Float64Array {
  const areas = new Float64Array(counts.components);
  faceAreas(vertices, faces).forEach((area, f) => (areas[component[f]] += area));
  return areas;
}

/** How many of `count` parts' faces there are, of the part of each face. */
export function partSizes(component: Iterable<number>, count: number): Int32Array {
  const sizes = new Int32Array(count);
  for (const part of component) sizes[part]++;
  return sizes;
}

/** The surface without its other parts; `components` is the only count that is of the rest. */
export function keepParts(surface: CleanSurface, kept: Uint8Array): CleanSurface {
  const { twin, component } = surface;
  const parts = placesOf(kept);
  const isKept = component.map((part) => kept[part]);
  const places = placesOf(isKept);
  const ofKept = (_: number, h: number) => isKept[faceOf(h)];
  const { vertices, faces } = dropUnused(surface.vertices, surface.faces.filter(ofKept));
  return {
    ...surface,
    vertices,
    faces,
    // A face that is kept has kept neighbours.
    twin: twin.filter(ofKept).map((t) => (t >= 0 ? 3 * places[faceOf(t)] + (t % 3) : -1)),
    component: component.filter((part) => kept[part]).map((part) => parts[part]),
    counts: { ...surface.counts, components: kept.reduce((count, is) => count + is, 0) },
  };
}

/** The place of each among those that are kept. */
function placesOf(kept: Uint8Array | Int32Array): Int32Array {
  let count = 0;
  return Int32Array.from(kept, (is) => (is ? count++ : count));
}

/** 0, 1, ... in ascending order of values; of equal ones, the first. */
const sortedPlaces = (values: Float64Array) =>
  Int32Array.from(values.keys()).sort((i, j) => values[i] - values[j] || i - j);
