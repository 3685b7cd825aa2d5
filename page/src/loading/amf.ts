// AMF: the volumes of all objects, where constellations place them; as XML, or that in a ZIP, as
// `model.loading.amf` reads them.

import { Matrix4 } from "three";
import { MeshError, type Mesh } from "../mesh";
import { isZip, unpack } from "./archive";
import { limit } from "./limits";
import { MeshObject, placedObjects, type Reference } from "./objects";
import { numberOf, readXml, wholeOf, type Tag } from "./xml";

// Elements that hold a number, in a vertex, a triangle or an instance.
const POINT = ["x", "y", "z"];
const TRIANGLE = ["v1", "v2", "v3"];
const PLACE = ["deltax", "deltay", "deltaz", "rx", "ry", "rz"];
const VALUES = new Set([...POINT, ...TRIANGLE, ...PLACE]);
// What Slic3r and PrusaSlicer say of volumes that are not part of the shape.
const SLICER = /^slic3r\.(modifier=(?!0)|volume_type=(?!ModelPart))/;

export function readAmf(data: Uint8Array): Mesh {
  if (isZip(data)) [data] = unpack(data, /\.amf$/).values();
  if (!data) throw new MeshError("truncated", "the ZIP archive holds no AMF file");
  const document = new Document();
  readXml(data, "the file", document.start, document.end);
  return placedObjects(document.objects, document.shown());
}

/** Objects and constellations, gathered from elements as they come. */
class Document {
  readonly objects = new Map<string, MeshObject>();
  private object = new MeshObject();
  private values: Record<string, string | undefined> = {}; // of the vertex, triangle or instance
  private instance = ""; // the object that it places
  private metadata = "";
  private first = 0; // triangle of the volume
  private isLeftOut = false;
  private placed = 0;

  start = (tag: Tag): boolean => {
    const { name } = tag;
    if (VALUES.has(name)) return !(name in this.values);
    if (name === "vertex" || name === "triangle") {
      this.values = {};
      return true;
    }
    if (name === "object" || name === "constellation") {
      limit("geometries", ++this.placed);
      this.object = new MeshObject();
      this.objects.set(tag.need("id"), this.object);
    } else if (name === "instance") {
      limit("geometries", ++this.placed);
      this.values = {};
      this.instance = tag.need("objectid");
    } else if (name === "volume") {
      this.first = this.object.corners.length / 3;
      this.isLeftOut = false;
    } else if (name === "metadata") {
      this.metadata = tag.get("type") ?? "";
    }
    return name === "coordinates";
  };

  end = (name: string, text: string): void => {
    if (VALUES.has(name)) this.values[name] = text;
    else if (name === "vertex") this.object.vertices.push(...this.numbers(POINT, numberOf));
    else if (name === "triangle") this.object.corners.push(...this.numbers(TRIANGLE, wholeOf));
    else if (name === "instance") this.object.components.push({ key: this.instance, matrix: this.matrix() });
    else if (name === "metadata" && SLICER.test(`${this.metadata}=${text}`)) this.isLeftOut = true;
    else if (name === "volume" && this.isLeftOut) {
      this.object.leftOut.push([this.first, this.object.corners.length / 3 - 1]);
    }
  };

  /** What no constellation places, which may be one itself. */
  shown(): Reference[] {
    const objects = [...this.objects.values()];
    const placed = new Set(objects.flatMap(({ components }) => components.map(({ key }) => key)));
    const free = [...this.objects.keys()].filter((key) => !placed.has(key));
    if (objects.length && !free.length) {
      throw new MeshError("bad-scene", "all constellations contain themselves");
    }
    return free.map((key) => ({ key, matrix: new Matrix4() }));
  }

  private numbers(names: string[], numberOf: (word: string) => number): number[] {
    return names.map((name) => numberOf(this.values[name] ?? ""));
  }

  /** Rotation about x, then y, then z, by degrees; then a shift. */
  private matrix(): Matrix4 {
    const [x, y, z, ...degrees] = PLACE.map((name) => numberOf(this.values[name] || "0"));
    const [aboutX, aboutY, aboutZ] = degrees.map((angle) => (angle * Math.PI) / 180);
    return new Matrix4()
      .makeRotationX(aboutX)
      .premultiply(new Matrix4().makeRotationY(aboutY))
      .premultiply(new Matrix4().makeRotationZ(aboutZ))
      .setPosition(x, y, z);
  }
}
