// Classify a prepared mesh by onnxruntime-node: node node.js WHOLE.onnx MESH.off
import { readFileSync } from "node:fs";
import * as ort from "onnxruntime-node";
import { open, readOff } from "./model.js";

const [model, mesh] = process.argv.slice(2).map((path) => new Uint8Array(readFileSync(path)));
const classify = await open(ort, model);
const ranked = await classify(readOff(new TextDecoder().decode(mesh)));
for (const [name, score] of ranked.slice(0, 3)) console.log(name, score);
