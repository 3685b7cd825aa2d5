// The colour map of evidence, as `service.attribution.colours` has it: linear in OKLab.

const AGAINST = [0.45, -0.025, -0.16];
const NEITHER = [0.94, 0, 0];
const FOR = [0.55, 0.14, 0.105];

const TO_CONES = [
  [1.0, 0.3963377774, 0.2158037573],
  [1.0, -0.1055613458, -0.0638541728],
  [1.0, -0.0894841775, -1.291485548],
];
const TO_RGB = [
  [4.0767416621, -3.3077115913, 0.2309699292],
  [-1.2684380046, 2.6097574011, -0.3413193965],
  [-0.0041960863, -0.7034186147, 1.707614701],
];

const times = (matrix: number[][], [x, y, z]: number[]) =>
  matrix.map(([a, b, c]) => a * x + b * y + c * z);

/** Linear light, 3 numbers in [0, 1], of a value, which is clipped to -1 to 1. */
export function linearColour(value: number): number[] {
  const strength = Math.min(Math.abs(value), 1);
  const end = value > 0 ? FOR : AGAINST;
  const lab = end.map((part, k) => (1 - strength) * NEITHER[k] + strength * part);
  const cones = times(TO_CONES, lab).map((root) => root ** 3);
  return times(TO_RGB, cones).map((light) => Math.min(Math.max(light, 0), 1));
}

/** sRGB, 3 bytes. */
export const srgbColour = (value: number) =>
  linearColour(value).map((light) =>
    Math.round(255 * (light <= 0.0031308 ? 12.92 * light : 1.055 * light ** (1 / 2.4) - 0.055)),
  );

/** Colours of eleven even steps from -1 to 1, as web colours. */
export const legendColours = () =>
  Array.from({ length: 11 }, (_, i) => {
    const bytes = srgbColour(i / 5 - 1);
    return `#${bytes.map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
  });
