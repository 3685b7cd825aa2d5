// Running a whole pipeline (meshconv3d export --whole); see docs/any-runtime.md.

/** Opens a file (a Uint8Array) by onnxruntime-node or -web. Gives a function from a prepared mesh to
 * pairs of a class and its score, the highest first. */
export async function open(ort, model) {
  const session = await ort.InferenceSession.create(model);
  const { classes } = readCard(model, "config");
  return async ({ vertices, faces }) => {
    const { scores } = await session.run({
      vertices: new ort.Tensor("float32", vertices, [vertices.length / 3, 3]),
      faces: new ort.Tensor("int64", BigInt64Array.from(faces, BigInt), [faces.length / 3, 3]),
    });
    return classes.map((name, i) => [name, scores.data[i]]).sort((a, b) => b[1] - a[1]);
  };
}

/** An entry of the card, which onnxruntime for JavaScript does not give: the file is searched
 * for the key and the length of its value, as protobuf has them. */
export function readCard(model, name) {
  const key = `meshconv3d.${name}`;
  const entry = [10, key.length, ...new TextEncoder().encode(key), 18];
  let at = model.findIndex((_, i) => entry.every((byte, k) => model[i + k] === byte));
  if (at < 0) throw new Error(`the file has no ${key}`);
  at += entry.length;
  let length = 0;
  for (let shift = 0, byte = 128; byte & 128; shift += 7) {
    byte = model[at++];
    length += (byte & 127) << shift;
  }
  return JSON.parse(new TextDecoder().decode(model.subarray(at, at + length)));
}

/** Vertices (3 V numbers) and faces (3 F) of an OFF file of triangles. */
export function readOff(text) {
  const words = text.trim().split(/\s+/);
  if (words[0] !== "OFF") throw new Error("not a text OFF file, the one format that is read here");
  const end = 4 + 3 * words[1];
  return {
    vertices: Float32Array.from(words.slice(4, end), Number),
    faces: Uint32Array.from(words.slice(end).filter((_, i) => i % 4), Number),
  };
}
