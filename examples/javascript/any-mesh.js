// Classify meshes that are not prepared: node any-mesh.js WHOLE.onnx MESH.off ...
import { readFileSync } from "node:fs";
import * as ort from "onnxruntime-node";
import { open, readOff } from "./model.js";
import { prepare } from "./prepare.js";

const [model, ...paths] = process.argv.slice(2);
const classify = await open(ort, new Uint8Array(readFileSync(model)));
for (const path of paths) {
  const { vertices, faces } = readOff(readFileSync(path, "utf8"));
  const [[name, score]] = await classify(await prepare(vertices, faces));
  console.log(name, score);
}
