// What the page asks, and what it is answered: by a service (`http`), or in this browser (`local`).

import type { MeshReport } from "./preparation";

export interface ClassScore {
  class: string;
  probability: number;
  score: number;
}

export interface Answer {
  file: string | null;
  class: string;
  probability: number;
  /** null where the model has no calibration. */
  unknown: boolean | null;
  /** How unlike every class. */
  novelty: number;
  scores: ClassScore[];
  model: { name: string; sha256: string };
  mesh: MeshReport;
  timings_ms: Record<string, number>;
}

/** A mesh of the library. */
export interface Alike {
  file: string;
  class: string;
  unknown: boolean | null;
  distance: number;
  same_shape: number | null;
  /** Address of its picture. */
  picture: string | null;
}

export interface Library {
  meshes: number;
  model: string;
}

/** What makes probabilities of scores, as `model.calibration` describes it. */
export interface Calibration {
  temperature: number;
  novelty_limit: number;
  novelty_scale: number;
  same_shape: [number, number] | null;
}

export interface Model {
  name: string;
  /** Of its file, where this browser loads it. */
  bytes?: number;
  sha256: string;
  config: { classes: string[]; pooling: "geometric" | "learned"; face_budget: number };
  /** Shares that are classified rightly: of test meshes, or of examples that were left out. */
  accuracy: { test?: number; left_out?: number };
  /** null where it had too few examples to fit its probabilities to. */
  calibration: Calibration | null;
  training: { taught?: { examples: Record<string, number> } } | null;
}

export interface Sample {
  name: string;
  file: string;
  bytes: number;
}

export interface Format {
  extension: string;
  aliases: string[];
  missing_extra: string | null;
}

export interface Limits {
  upload_bytes: number;
}

/** Hears what share is sent, or loaded, of how many bytes. */
export type Progress = (share: number, bytes: number) => void;

export interface Backend {
  /** What takes the time before classification, for "Sending 3 MB …". */
  readonly verb: "Sending" | "Loading";
  /** Where the files go, and what is loaded for a model, in a sentence or two. */
  about(model: string): string;
  models(): Promise<Model[]>;
  samples(): Promise<Sample[]>;
  sampleFile(sample: Sample): Promise<File>;
  formats(): Promise<Format[]>;
  limits(): Promise<Limits>;
  library(): Promise<Library | null>;
  /** Classify a file, which comes first, with its pieces. */
  classify(files: File[], model: string, progress: Progress): Promise<Answer>;
  /** The meshes of the library that are most like a file, the nearest first. */
  similar(files: File[]): Promise<Alike[]>;
  /** A file explained, by the default model for its likeliest class where the query names none. */
  explain(files: File[], query: Query, form: Form, signal?: AbortSignal): Promise<Blob>;
}

export interface Query {
  model?: string;
  class?: string;
}

/** What a file is explained as: coloured meshes, or numbers. */
export type Form = "glb" | "ply" | "json";

/** Why there is no answer: words for people, and whether to ask again may help. */
export class Refused extends Error {
  constructor(
    readonly title: string,
    message: string,
    readonly again: boolean,
    readonly requestId: string | null = null,
    /** Whether the service wants a key, or another one. */
    readonly wantsKey = false,
  ) {
    super(message);
  }
}

export const asRefused = (error: unknown) =>
  error instanceof Refused ? error : new Refused("This page failed", String(error), true);

/** What is wrong with a file, for the heading of its words. */
export const TITLES = {
  unreadable: "This file cannot be read",
  large: "This file is too large",
  format: "This format is not read",
  unusable: "This file holds no usable mesh",
  slow: "This mesh takes too long",
};

/** A message of a fault as a sentence. */
export function sentence(text: string): string {
  const start = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(start) ? start : `${start}.`;
}
