// The service over HTTP. Paths are relative to the page.

import type { Alike, Answer, Backend, Form, Format, Library, Limits, Model, Progress, Query, Sample } from "./api";
import { Refused, sentence, TITLES } from "./api";
import { keyHeaders } from "./key";

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

const models = async () => (await getJson<{ models: Model[] }>("v1/models")).models;
const samples = async () => (await getJson<{ samples: Sample[] }>("v1/samples")).samples;
const formats = async () => (await getJson<{ formats: Format[] }>("v1/formats")).formats;
const limits = () => getJson<Limits>("v1/limits");

async function sampleFile(sample: Sample): Promise<File> {
  const response = await get(`v1/samples/${encodeURIComponent(sample.file)}`);
  return new File([await response.blob()], sample.file);
}

const library = async () =>
  (await getJson<{ library: Library | null }>("v1/library")).library;

async function classify(files: File[], model: string, progress: Progress): Promise<Answer> {
  const blob = await post(files, "v1/classify", { model }, "application/json", progress);
  return JSON.parse(await blob.text()) as Answer;
}

async function similar(files: File[]): Promise<Alike[]> {
  const blob = await post(files, "v1/similar", {}, "application/json");
  const found = (JSON.parse(await blob.text()) as { similar: Alike[] }).similar;
  return found.map((one) => ({
    ...one,
    picture: one.picture && `data:image/png;base64,${one.picture}`,
  }));
}

const MEDIA_TYPES: Record<Form, string> = {
  glb: "model/gltf-binary",
  ply: "model/ply",
  json: "application/json",
};

const explain = (files: File[], query: Query, form: Form, signal?: AbortSignal) =>
  post(files, "v1/explain", { ...query }, MEDIA_TYPES[form], undefined, signal);

export const http: Backend = {
  verb: "Sending",
  about: () => "Nothing leaves this service.",
  models,
  samples,
  sampleFile,
  formats,
  limits,
  library,
  classify,
  similar,
  explain,
};

// fetch() cannot tell how much of a body is sent.
function post(
  files: File[],
  path: string,
  query: Record<string, string>,
  accept: string,
  progress: Progress = () => {},
  signal?: AbortSignal,
): Promise<Blob> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", `${path}?${new URLSearchParams(query)}`);
    request.responseType = "blob";
    const headers = { accept, ...keyHeaders() };
    for (const [name, value] of Object.entries(headers)) request.setRequestHeader(name, value);
    request.upload.onprogress = (event) => {
      if (event.lengthComputable) progress(event.loaded / event.total, event.total);
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

const STATUSES: Record<number, string> = {
  400: TITLES.unreadable,
  404: "There is no such thing here",
  408: "The upload took too long",
  413: TITLES.large,
  415: TITLES.format,
  422: TITLES.unusable,
  503: "The service is busy",
  504: TITLES.slow,
};

function refusal(status: number, text: string): Refused {
  const again = [408, 500, 503, 504].includes(status);
  const title = STATUSES[status] ?? "The service failed on this file";
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
