// What the service is asked, and what it answers. Paths are relative to the page.

import { keyHeaders } from "./key";

export interface ClassScore {
  class: string;
  probability: number;
  score: number;
}

export interface MeshReport {
  faces_in: number;
  faces_used: number;
  vertices_merged: number;
  degenerate_dropped: number;
  duplicates_dropped: number;
  nonmanifold_edges: number;
  flipped: number;
  components: number;
  border_edges: number;
  watertight: boolean;
  resampled: "none" | "decimated" | "subdivided";
  within_budget: boolean;
  components_lost: number;
  area_kept: number;
}

export interface Answer {
  file: string | null;
  class: string;
  probability: number;
  /** null where the model has no calibration. */
  unknown: boolean | null;
  scores: ClassScore[];
  model: { name: string; sha256: string };
  mesh: MeshReport;
  timings_ms: Record<string, number>;
}

/** A mesh of the service's library. */
export interface Alike {
  file: string;
  class: string;
  unknown: boolean | null;
  distance: number;
  same_shape: number | null;
  picture: string | null;
}

export interface Library {
  meshes: number;
  model: string;
}

export interface Model {
  name: string;
  config: { classes: string[]; pooling: "geometric" | "learned" };
  /** Shares that are classified rightly: of test meshes, or of examples that were left out. */
  accuracy: { test?: number; left_out?: number };
  /** null where it had too few examples to fit its probabilities to. */
  calibration: object | null;
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

const SILENT = new Refused(
  "The service does not answer",
  "It may be starting, or the connection is gone. Try again in a moment.",
  true,
);

async function get(path: string): Promise<Response> {
  const response = await fetch(path, { headers: keyHeaders() }).catch(() => {
    throw SILENT;
  });
  if (!response.ok) throw refusal(response.status, await response.text());
  return response;
}

const getJson = async <Value>(path: string) => (await (await get(path)).json()) as Value;

export const models = async () => (await getJson<{ models: Model[] }>("v1/models")).models;
export const samples = async () => (await getJson<{ samples: Sample[] }>("v1/samples")).samples;
export const formats = async () => (await getJson<{ formats: Format[] }>("v1/formats")).formats;
export const limits = () => getJson<Limits>("v1/limits");

export async function sampleFile(sample: Sample): Promise<File> {
  const response = await get(`v1/samples/${encodeURIComponent(sample.file)}`);
  return new File([await response.blob()], sample.file);
}

export const library = async () =>
  (await getJson<{ library: Library | null }>("v1/library")).library;

export type Progress = (share: number) => void;

/** Classify a file, which comes first, with its pieces; `progress` hears what share of it is sent. */
export async function classify(files: File[], model: string, progress: Progress): Promise<Answer> {
  const blob = await post(files, "v1/classify", { model }, "application/json", progress);
  return JSON.parse(await blob.text()) as Answer;
}

/** The meshes of the library that are most like a file, the nearest first. */
export async function similar(files: File[]): Promise<Alike[]> {
  const blob = await post(files, "v1/similar", {}, "application/json", () => {});
  return (JSON.parse(await blob.text()) as { similar: Alike[] }).similar;
}

/** A file explained, in one of the media types that the service offers. */
export const explain = (
  files: File[],
  query: { model?: string; class?: string },
  accept: string,
  signal?: AbortSignal,
) => post(files, "v1/explain", query, accept, () => {}, signal);

// fetch() cannot tell how much of a body is sent.
function post(
  files: File[],
  path: string,
  query: Record<string, string>,
  accept: string,
  progress: Progress,
  signal?: AbortSignal,
): Promise<Blob> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", `${path}?${new URLSearchParams(query)}`);
    request.responseType = "blob";
    const headers = { accept, ...keyHeaders() };
    for (const [name, value] of Object.entries(headers)) request.setRequestHeader(name, value);
    request.upload.onprogress = (event) => {
      if (event.lengthComputable) progress(event.loaded / event.total);
    };
    request.onerror = () => reject(SILENT);
    request.onabort = () => reject(signal?.reason);
    signal?.addEventListener("abort", () => request.abort());
    request.onload = async () => {
      const body = request.response as Blob;
      if (request.status === 200) resolve(body);
      else reject(refusal(request.status, await body.text()));
    };
    const form = new FormData();
    for (const file of files) form.append("file", file, file.name);
    request.send(form);
  });
}

const TITLES: Record<number, string> = {
  400: "This file cannot be read",
  404: "There is no such thing here",
  408: "The upload took too long",
  413: "This file is too large",
  415: "This format is not read",
  422: "This file holds no usable mesh",
  503: "The service is busy",
  504: "This mesh takes too long",
};

function refusal(status: number, text: string): Refused {
  const again = [408, 500, 503, 504].includes(status);
  const title = TITLES[status] ?? "The service failed on this file";
  try {
    const problem = JSON.parse(text) as { detail: string; fault: string; request_id: string };
    if (status === 401) return keyRefusal(problem.fault, problem.request_id);
    return new Refused(title, sentence(problem.detail), again, problem.request_id);
  } catch {
    // Not from this service, but from something in front of it.
    const words =
      status === 413
        ? "Something in front of the service takes no file of this size. Simplify the mesh, or use a binary format (STL, PLY, GLB)."
        : `The answer was HTTP status ${status}.`;
    return new Refused(title, words, again);
  }
}

function keyRefusal(fault: string, requestId: string): Refused {
  const [title, message] =
    fault === "wrong-api-key"
      ? ["This key is wrong", "The service does not know it. Ask who runs the service for one."]
      : ["The service asks for a key", "It stays in this tab, and goes to this service alone."];
  return new Refused(title, message, true, requestId, true);
}

function sentence(text: string): string {
  const start = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(start) ? start : `${start}.`;
}
