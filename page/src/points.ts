// A surface as points.

/** Points spread over the surface by its area, the same at every call. */
export function pointsOn(positions: Float32Array, count: number): Float32Array {
  const faces = positions.length / 9;
  const ends = new Float64Array(faces);
  let total = 0;
  for (let f = 0; f < faces; f++) {
    const p = positions.subarray(9 * f, 9 * f + 9);
    const [ux, uy, uz] = [p[3] - p[0], p[4] - p[1], p[5] - p[2]];
    const [vx, vy, vz] = [p[6] - p[0], p[7] - p[1], p[8] - p[2]];
    total += Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
    ends[f] = total;
  }
  const points = new Float32Array(3 * count);
  for (let i = 0, f = 0; i < count; i++) {
    while (f < faces - 1 && ends[f] < ((i + 0.5) / count) * total) f++;
    // Steps of an irrational size spread evenly over the square, folded into the triangle.
    let [s, t] = [(i * 0.7548776662) % 1, (i * 0.5698402909) % 1];
    if (s + t > 1) [s, t] = [1 - s, 1 - t];
    for (let k = 0; k < 3; k++) {
      const [a, b, c] = [positions[9 * f + k], positions[9 * f + 3 + k], positions[9 * f + 6 + k]];
      points[3 * i + k] = a + s * (b - a) + t * (c - a);
    }
  }
  return points;
}
