// From the network's outputs to an answer, as `service.classifier` and `service.records` make it.

import type { Answer, ClassScore, Model } from "../api";
import type { MeshReport } from "../preparation";

/** The network's outputs for one mesh. scores: N_c logits. */
export interface Outputs {
  scores: Float32Array;
  novelty: number;
}

// Where less than this share of the area is left, the rest tells little (`model.preparation`).
const AREA_KEPT = 0.15;

export function answerOf(
  file: string,
  model: Model,
  { scores, novelty }: Outputs,
  mesh: MeshReport,
  timings_ms: Record<string, number>,
): Answer {
  const { probabilities, unknown } = calibrated(model, scores, novelty, mesh);
  const { classes } = model.config;
  const ranked = classes
    .map((name, i): ClassScore => ({
      class: name,
      probability: rounded(probabilities[i], 6),
      score: rounded(scores[i], 5),
    }))
    .map((score, i) => ({ score, logit: scores[i] }))
    .sort((a, b) => b.logit - a.logit)
    .map(({ score }) => score);
  return {
    file,
    class: ranked[0].class,
    probability: ranked[0].probability,
    unknown,
    novelty: rounded(novelty, 4),
    scores: ranked,
    model: { name: model.name, sha256: model.sha256 },
    mesh,
    timings_ms,
  };
}

function calibrated(
  { calibration }: Model,
  scores: Float32Array,
  novelty: number,
  mesh: MeshReport,
): { probabilities: number[]; unknown: boolean | null } {
  if (!calibration) return { probabilities: softmax(scores, 1), unknown: null };
  const { temperature, novelty_limit, novelty_scale } = calibration;
  let known = logistic((novelty_limit - novelty) / novelty_scale);
  if (mesh.area_kept < AREA_KEPT) known *= mesh.area_kept / AREA_KEPT / 2;
  const probabilities = softmax(scores, temperature).map((value) => known * value);
  return { probabilities, unknown: known < 0.5 };
}

function softmax(scores: Float32Array, temperature: number): number[] {
  const most = Math.max(...scores);
  const powers = Array.from(scores, (score) => Math.exp((score - most) / temperature));
  const sum = powers.reduce((total, power) => total + power, 0);
  return powers.map((power) => power / sum);
}

export const logistic = (value: number) => 1 / (1 + Math.exp(-value));

export const rounded = (value: number, digits: number) => Number(value.toFixed(digits));
