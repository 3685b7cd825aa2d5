// Loads and prepares mesh files under Node.js, for tests and benchmarks: node prepare.js BUDGET FILE ...
// Prints a line of JSON for each: arrays in base64, or the error.
import { readFile } from "node:fs/promises";
import { basename, dirname } from "node:path";
import { fileURLToPath } from "node:url";
import { runnerImport } from "vite";

const [budget, ...files] = process.argv.slice(2);
const source = async (path) => {
  const options = { root: dirname(fileURLToPath(import.meta.url)), configFile: false, logLevel: "error" };
  return (await runnerImport(`./src/${path}`, options)).module;
};
const { load } = await source("loading/index.ts");
const { prepare } = await source("preparation/index.ts");

const packed = ({ vertices, faces }) => ({ vertices: base64(vertices), faces: base64(faces) });
const base64 = (array) => Buffer.from(array.buffer, array.byteOffset, array.byteLength).toString("base64");

async function answer(file) {
  const { buffer, byteOffset, byteLength } = await readFile(file);
  try {
    const mesh = await load(basename(file), buffer.slice(byteOffset, byteOffset + byteLength));
    try {
      const { report, centre, radius, ...prepared } = prepare(
        mesh.vertices,
        mesh.faces,
        Number(budget),
        mesh.note,
      );
      return { loaded: packed(mesh), prepared: packed(prepared), report, centre, radius };
    } catch (error) {
      return { loaded: packed(mesh), fault: error.fault, error: error.message };
    }
  } catch (error) {
    return { fault: error.fault, error: error.message };
  }
}

for (const file of files) console.log(JSON.stringify(await answer(file)));
