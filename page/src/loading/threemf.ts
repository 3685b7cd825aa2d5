// 3MF: the meshes that the build places, from all model parts of the package, as `model.loading.threemf`
// reads them.

import { Matrix4 } from "three";
import { MeshError, type Mesh } from "../mesh";
import { partName, unpack } from "./archive";
import { limit } from "./limits";
import { MeshObject, placedObjects, type Reference } from "./objects";
import { quoted } from "./text";
import { numberOf, readXml, wholeOf, type Tag } from "./xml";

const ROOT_KIND = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
const RELATIONS = "_rels/.rels";
const USUAL_ROOT = "3d/3dmodel.model";
const PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06";
// Namespaces of extensions that leave the triangles as they are, or that are read.
const HARMLESS = /\/(core|production|material|slice|beamlattice|trianglesets)\//;
const SUPPORTS = ["support", "solidsupport"]; // types of object that are not part of the shape
// What slicers say of volumes: PrusaSlicer and its relatives of runs of triangles, BambuStudio and
// OrcaSlicer of components.
const VOLUMES = [
  "metadata/slic3r_pe_model.config",
  "metadata/superslicer_model.config",
  "metadata/model_settings.config",
];

type Parts = Map<string, Uint8Array>;

export function read3mf(data: Uint8Array): Mesh {
  // All but pictures and what prints.
  const parts = unpack(data, /\.(model|rels|config)$|^[^.]*$/);
  const root = rootPart(parts);
  const { objects, build } = collect(parts, root);
  for (const name of VOLUMES) {
    const volumes = parts.get(name);
    if (volumes) leaveOut(volumes, name, objects, root);
  }
  return placedObjects(objects, build);
}

/** References should be relative to the folder of the part, or begin with a slash, which some forget. */
function find(parts: Parts, reference: string, source = ""): string {
  const name = partName(reference, source);
  const fromRoot = partName(`/${reference}`);
  return !parts.has(name) && parts.has(fromRoot) ? fromRoot : name;
}

/** The part that the package names as its 3D model, or the one that usually is. */
function rootPart(parts: Parts): string {
  const targets: string[] = [];
  const relations = parts.get(RELATIONS);
  if (relations) {
    readXml(relations, RELATIONS, (tag) => {
      const isExternal = tag.get("TargetMode") === "External";
      if (tag.get("Type") === ROOT_KIND && !isExternal) targets.push(find(parts, tag.need("Target")));
    });
  }
  if (targets.length) return targets[0];
  if (parts.has(USUAL_ROOT)) return USUAL_ROOT;
  throw new MeshError("bad-header", "the zip archive is no 3MF package: it names no 3D model part");
}

/** All objects of the model parts that the root refers to, and the items of its build. */
function collect(parts: Parts, root: string) {
  const objects = new Map<string, MeshObject>();
  const names = [root];
  const units = new Set<string>();
  let build: Reference[] = [];
  // The list grows as it is gone through.
  for (const name of names) {
    const part = new ModelPart(name, parts);
    for (const [key, object] of part.objects) objects.set(key, object);
    units.add(part.unit);
    if (name === root) build = part.build;
    for (const used of part.used) if (!names.includes(used)) names.push(used);
  }
  if (units.size > 1) {
    const shown = quoted([...units].sort().join(", "));
    throw new MeshError("unsupported-feature", `the parts of the package mix units (${shown})`);
  }
  return { objects, build };
}

const keyOf = (part: string, id: string) => `${id} of ${part}`;

/** One model part: its objects by their keys, what it builds, and the parts that these are in. */
class ModelPart {
  readonly objects = new Map<string, MeshObject>();
  readonly build: Reference[] = [];
  readonly used = new Set<string>();
  unit = "millimeter";
  private namespace: string | null = null;
  private object = new MeshObject();
  private placed = 0;

  constructor(
    private readonly name: string,
    private readonly parts: Parts,
  ) {
    const data = parts.get(name);
    if (!data) throw new MeshError("missing-data", `the package has no part ${quoted(name)}`);
    readXml(data, name, this.start);
  }

  private start = (tag: Tag): boolean => {
    if (this.namespace === null) this.model(tag);
    // Elements of other namespaces than the root's are passed over.
    if (tag.namespace !== this.namespace) return false;
    if (tag.name === "vertex") {
      for (const axis of ["x", "y", "z"]) this.object.vertices.push(numberOf(tag.need(axis)));
      return true;
    }
    if (tag.name === "triangle") {
      for (const corner of ["v1", "v2", "v3"]) this.object.corners.push(wholeOf(tag.need(corner)));
      return true;
    }
    if (tag.name === "object") {
      limit("geometries", ++this.placed);
      this.object = new MeshObject();
      this.object.isSupport = SUPPORTS.includes(tag.get("type") ?? "");
      this.objects.set(keyOf(this.name, tag.need("id")), this.object);
    } else if (tag.name === "component") {
      this.object.components.push(this.reference(tag));
    } else if (tag.name === "item") {
      this.build.push(this.reference(tag));
    }
    return false;
  };

  private model(tag: Tag): void {
    if (tag.name !== "model") throw new MeshError("bad-header", `${quoted(this.name)} is no 3D model`);
    this.namespace = tag.namespace;
    this.unit = tag.get("unit") ?? this.unit;
    for (const prefix of (tag.get("requiredextensions") ?? "").split(/\s+/).filter(Boolean)) {
      const namespace = tag.get(`xmlns:${prefix}`) ?? prefix;
      if (HARMLESS.test(namespace)) continue;
      throw new MeshError(
        "unsupported-feature",
        `the file requires the extension ${quoted(namespace)}, which is not read; ` +
          "export as core 3MF without it",
      );
    }
  }

  /** The object that an item or component names, and where it places it. */
  private reference(tag: Tag): Reference {
    limit("geometries", ++this.placed);
    const path = tag.get("path", PRODUCTION);
    const part = path === undefined ? this.name : find(this.parts, path, this.name);
    this.used.add(part);
    const matrix = new Matrix4();
    const transform = tag.get("transform");
    if (transform !== undefined) {
      const words = transform.trim().split(/\s+/);
      if (words.length !== 12) throw new MeshError("bad-number", "a transform must be 12 numbers");
      const [a, b, c, d, e, f, g, h, i, x, y, z] = words.map((word) => numberOf(word));
      matrix.set(a, d, g, x, b, e, h, y, c, f, i, z, 0, 0, 0, 1); // stored by columns
    }
    return { key: keyOf(part, tag.need("objectid")), matrix };
  }
}

/** Take from objects what a slicer says is no part of the shape: modifiers of settings, negative
 * volumes, and what asks for supports or forbids them. */
function leaveOut(data: Uint8Array, name: string, objects: Map<string, MeshObject>, root: string): void {
  let object = new MeshObject();
  let run: [number, number] | null = null;
  const start = (tag: Tag): void => {
    if (tag.name === "object") {
      object = objects.get(keyOf(root, tag.get("id") ?? "")) ?? new MeshObject();
    } else if (tag.name === "volume") {
      const words = [tag.get("firstid") ?? "", tag.get("lastid") ?? ""];
      run = words.every((word) => /^\d{1,9}$/.test(word)) ? [Number(words[0]), Number(words[1])] : null;
    } else if (tag.name === "metadata" && run && tag.get("type") === "volume") {
      const [key, value] = [tag.get("key"), tag.get("value")];
      const isOther = key === "volume_type" && value !== "ModelPart";
      if (isOther || (key === "modifier" && value === "1")) object.leftOut.push(run);
    } else if (tag.name === "part" && (tag.get("subtype") ?? "normal_part") !== "normal_part") {
      const id = tag.get("id");
      object.components = object.components.filter(({ key }) => key.slice(0, key.indexOf(" of ")) !== id);
    }
  };
  try {
    readXml(data, name, start);
  } catch {
    // Older slicers wrote names into it that make it no XML.
  }
}
