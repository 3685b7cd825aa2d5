// From a file to its class and the reasons: reading, preparation, and the graph by onnxruntime-web.

import { env, InferenceSession, Tensor } from "onnxruntime-web/wasm";
import type { Answer } from "../api";
import { load } from "../loading";
import type { Pieces } from "../loading/gltf";
import type { Mesh } from "../mesh";
import { prepare } from "../preparation";
import { contributions, densitiesOf, ontoFile, type Pool } from "./attribution";
import type { LocalModel } from "./build";
import type { Explanation } from "./explanation";
import { answerOf } from "./prediction";

/** All that one run of a model tells of a file. */
export interface Pass {
  answer: Answer;
  embedding: Float32Array;
  file: Mesh;
  /** In the coordinates of the file. */
  prepared: Mesh;
  /** N_L x N_c: of the faces of the last level, by class. */
  evidence: Float32Array;
  pools: Pool[];
  scores: Float32Array;
}

/** Start the runtime. wasm: its WebAssembly. */
export function start(wasm: ArrayBuffer): void {
  env.wasm.wasmBinary = wasm;
  env.wasm.numThreads = 1; // more need a page that is isolated from other sites
}

export class Pipeline {
  private constructor(
    private readonly model: LocalModel,
    private readonly session: InferenceSession,
  ) {}

  static async open(model: LocalModel, content: ArrayBuffer): Promise<Pipeline> {
    return new Pipeline(model, await InferenceSession.create(content));
  }

  /** Classify a file. name: it tells the format, by its extension. Throws MeshError. */
  async run(name: string, data: ArrayBuffer, pieces: Pieces): Promise<Pass> {
    const timings: Record<string, number> = {};
    const timed = async <Value>(stage: string, work: () => Value | Promise<Value>) => {
      const begun = performance.now();
      const value = await work();
      timings[stage] = Math.round(1000 * (performance.now() - begun)) / 1000;
      return value;
    };
    const { config } = this.model;
    const file = await timed("read", () => load(name, data, pieces));
    const made = await timed("prepare", () => prepare(file.vertices, file.faces, config.face_budget, file.note));
    const outputs = await timed("infer", () =>
      this.session.run({
        vertices: new Tensor("float32", Float32Array.from(made.vertices), [made.vertices.length / 3, 3]),
        faces: new Tensor("int64", BigInt64Array.from(made.faces, BigInt), [made.faces.length / 3, 3]),
      }),
    );
    const floats = (output: string) => outputs[output].data as Float32Array;
    const scores = floats("scores");
    const pools = Object.keys(outputs)
      .filter((output) => output.startsWith("whole.pools_"))
      .sort()
      .map((output) => ({
        indices: outputs[output].data as Int32Array,
        width: outputs[output].dims[1],
      }));
    return {
      answer: answerOf(name, this.model, { scores, novelty: floats("novelty")[0] }, made.report, timings),
      embedding: floats("embedding"),
      file,
      prepared: {
        vertices: made.vertices.map((x, i) => x * made.radius + made.centre[i % 3]),
        faces: made.faces,
      },
      evidence: floats("evidence"),
      pools,
      scores,
    };
  }

  /** Explain a class; null: the likeliest. */
  explain(pass: Pass, label: string | null): Explanation {
    const { classes } = this.model.config;
    const wanted = label ?? pass.answer.class;
    const index = classes.indexOf(wanted);
    const evidence = Float64Array.from(
      { length: pass.evidence.length / classes.length },
      (_, face) => pass.evidence[face * classes.length + index],
    );
    const begun = performance.now();
    const shares = contributions(evidence, pass.pools, pass.prepared.faces);
    const added = ontoFile(shares, pass.prepared, pass.file);
    const explain = Math.round(1000 * (performance.now() - begun)) / 1000;
    const score = pass.scores[index];
    const mean = evidence.reduce((sum, value) => sum + value, 0) / evidence.length;
    return {
      answer: { ...pass.answer, timings_ms: { ...pass.answer.timings_ms, explain } },
      class: wanted,
      score,
      bias: score - mean,
      mesh: pass.file,
      contributions: added,
      ...densitiesOf(added, pass.file),
    };
  }
}
