// What `meshconv3d page` writes beside the page.

import type { Format, Library, Limits, Model, Sample } from "../api";

/** A file that is loaded when it is needed. path: relative to the page. */
export interface Download {
  path: string;
  bytes: number;
}

/** A whole pipeline in ONNX, and its card. */
export type LocalModel = Model & Download;

export interface Build {
  /** WebAssembly of onnxruntime-web, packed by gzip. */
  runtime: Download;
  models: LocalModel[];
  samples: (Sample & Download)[];
  formats: Format[];
  limits: Limits;
  library: LocalLibrary | null;
}

/** embeddings: float32, one after another; entries: JSON, one for each of them. */
export interface LocalLibrary extends Library {
  embeddings: Download;
  entries: Download;
}
