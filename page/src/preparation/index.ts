// Preparation: any triangle mesh becomes an oriented manifold of the face budget, as
// `model.preparation` makes it, number for number.

import { check, MeshError, type Mesh } from "../mesh";
import { clean, type CleanSurface, type Counts } from "./cleaning";
import { farthest, faceGeometry, surfaceArea, surfaceCentroid, type Vector } from "./geometry";
import { dropDust, fittingParts, keepParts, partAreas, partSizes, scrapArea } from "./parts";
import { simplify } from "./simplification";
import { subdivide } from "./subdivision";

// Simplification that changes the area by more than this has destroyed the shape.
const AREA_KEPT = [0.15, 2];
// More faces than so many budgets take the graph seconds.
const MOST_BUDGETS = 12;

/** Counts of one preparation, as in the answers of the service. */
export interface MeshReport extends Counts {
  faces_in: number;
  faces_used: number;
  resampled: "none" | "decimated" | "subdivided";
  within_budget: boolean;
  components_lost: number;
  area_kept: number;
  note: string;
}

/** A prepared mesh. centre, radius: of its unit sphere, in the file. */
export interface Prepared extends Mesh {
  report: MeshReport;
  centre: Vector;
  radius: number;
}

/** Clean, bring to `budget` faces, centre, scale into the unit sphere, round to float32. vertices: 3 V
 * numbers; faces: 3 F; note: that of reading them. Throws MeshError for what is no mesh, where no
 * surface with area is left, and where simplification destroyed it. */
export function prepare(vertices: Float64Array, faces: Int32Array, budget: number, note = ""): Prepared {
  const mesh = { vertices, faces };
  check(mesh);
  const surface = clean(mesh);
  const parts = surface.counts.components;
  const dusted = dropDust(surface, budget);
  const { resampled, left, ...result } = resample(dusted, budget);
  const partsLeft = left.counts.components;
  const dropped = dusted.counts.components - partsLeft;
  const [facesIn, facesUsed] = [faces.length / 3, result.faces.length / 3];
  let areaKept = 1;
  let shapeKept = 1;
  if (resampled !== "none" || result.faces.length < surface.faces.length) {
    const area = surfaceArea(result.vertices, result.faces);
    const before = surfaceArea(surface.vertices, surface.faces);
    areaKept = shapeKept = area / before;
    if (dropped) shapeKept = area / (before - scrapArea(dusted) + scrapArea(left));
  }
  if (!(AREA_KEPT[0] <= shapeKept && shapeKept <= AREA_KEPT[1])) {
    throw new MeshError(
      "lost-in-simplification",
      `simplifying ${facesIn} faces to ${budget} changed the surface area to ` +
        `${Math.round(100 * shapeKept)}%: the shape is too intricate (folds, hair, many loose parts); ` +
        "export a simpler version of the mesh",
    );
  }
  if (facesUsed > MOST_BUDGETS * budget) {
    throw new MeshError(
      "lost-in-simplification",
      `${facesIn} faces cannot be simplified below ${facesUsed} without changing the ` +
        `topology, and the model takes ${budget}: the surface has too many holes or ` +
        "borders; export a simpler version of the mesh",
    );
  }
  const centre = surfaceCentroid(faceGeometry(result.vertices, result.faces));
  const radius = farthest(result.vertices, centre);
  return {
    // float32, in which the graph takes them: equal weights of faces else part in another way there.
    vertices: result.vertices.map((value, i) => Math.fround((value - centre[i % 3]) / radius)),
    faces: result.faces,
    report: {
      ...surface.counts,
      faces_in: facesIn,
      faces_used: facesUsed,
      resampled,
      within_budget: facesUsed <= budget,
      components_lost: parts - partsLeft,
      area_kept: Number(areaKept.toFixed(4)),
      note: [note, dropped && `${dropped} of ${parts} parts were dropped`].filter(Boolean).join("; "),
    },
    centre: [0, 1, 2].map((k) => surface.corner[k] + surface.size * centre[k]) as Vector,
    radius: surface.size * radius,
  };
}

/** A surface at the budget, how it came there, and the surface without the parts that were dropped. */
interface Resampled extends Mesh {
  resampled: MeshReport["resampled"];
  left: CleanSurface;
}

function resample(surface: CleanSurface, budget: number): Resampled {
  let mesh: Mesh = { vertices: surface.vertices, faces: surface.faces };
  let resampled: MeshReport["resampled"] = "none";
  if (mesh.faces.length / 3 > budget) {
    const { origin, ...simplified } = simplify(mesh, surface.twin, budget);
    mesh = simplified;
    const parts = surface.counts.components;
    if (origin.length > budget && parts > 1) {
      const sizes = partSizes(
        origin.map((f) => surface.component[f]),
        parts,
      );
      // Once more without the others: faces that these took are there for the rest.
      return resample(keepParts(surface, fittingParts(partAreas(surface), sizes, budget)), budget);
    }
    if (mesh.faces.length < surface.faces.length) resampled = "decimated";
  }
  if (mesh.faces.length / 3 < budget - 1) {
    mesh = subdivide(mesh, budget);
    if (resampled === "none") resampled = "subdivided";
  }
  return { ...mesh, resampled, left: surface };
}
