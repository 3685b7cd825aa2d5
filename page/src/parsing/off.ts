// OFF, which three.js does not read: one vertex or polygon a line, with or without extras.

import { fans, type Soup } from "./soup";

export function readOff(text: string): Soup {
  const lines = text
    .split(/\r\n|\r|\n/)
    .map((line) => line.replace(/#.*/, "").trim())
    .filter(Boolean);
  const head = lines.shift() ?? "";
  // The counts may stand beside the keyword.
  const rest = head.replace(/^[A-Z4n]*OFF\s*/, "");
  const counts = (rest || lines.shift() || "").split(/\s+/).map(Number);
  const [vertexCount, faceCount] = counts;
  const vertices = new Float64Array(3 * vertexCount);
  for (let v = 0; v < vertexCount; v++) {
    const numbers = lines[v].split(/\s+/);
    for (let k = 0; k < 3; k++) vertices[3 * v + k] = Number(numbers[k]);
  }
  const polygons = lines.slice(vertexCount, vertexCount + faceCount).map((line) => {
    const numbers = line.split(/\s+/).map(Number);
    return numbers.slice(1, 1 + numbers[0]);
  });
  return fans(vertices, polygons);
}
