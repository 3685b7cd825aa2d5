// Files of the build, with words for what can go wrong on their way.

import { Refused } from "../api";
import type { Download } from "./build";

interface Loading {
  content: Promise<ArrayBuffer>;
  received: number;
  listeners: (() => void)[];
}

/** Files that were asked for. Each is loaded once, or again after it could not be. */
export class Downloads {
  private readonly files = new Map<string, Loading>();

  /** Bytes of a file that have come. */
  received = ({ path }: Download) => this.files.get(path)?.received ?? 0;

  /** The content of a file; `listener` hears when more of it has come. */
  get(file: Download, listener: () => void = () => {}): Promise<ArrayBuffer> {
    const known = this.files.get(file.path);
    if (known) {
      known.listeners.push(listener);
      return known.content;
    }
    const loading: Loading = { content: null!, received: 0, listeners: [listener] };
    loading.content = download(file, (bytes) => {
      loading.received = bytes;
      for (const hear of loading.listeners) hear();
    });
    loading.content.catch(() => this.files.delete(file.path));
    this.files.set(file.path, loading);
    return loading.content;
  }
}

async function download(
  { path, bytes }: Download,
  received: (bytes: number) => void,
): Promise<ArrayBuffer> {
  const response = await fetch(path).catch(() => null);
  if (!response?.ok || !response.body) throw notLoaded(path, response?.status);
  const content = new Uint8Array(bytes);
  const reader = response.body.getReader();
  let length = 0;
  for (;;) {
    const { done, value } = await reader.read().catch(() => {
      throw notLoaded(path);
    });
    if (done) break;
    if (length + value.length > bytes) throw notLoaded(path);
    content.set(value, length);
    length += value.length;
    received(length);
  }
  if (length < bytes) throw notLoaded(path);
  return content.buffer;
}

/** What gzip has packed. It is packed in its file, since few hosts would pack it on its way. */
export async function unpacked(content: ArrayBuffer): Promise<ArrayBuffer> {
  const stream = new Blob([content]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

function notLoaded(path: string, status?: number): Refused {
  const file = path.split("?")[0];
  const why = status
    ? `The host of this page answers ${status} for ${file}. Its owner has to put all files of the build there.`
    : `${file} did not come whole. Try again with a connection; what was loaded once is kept.`;
  return new Refused("This page lacks what it needs", why, true);
}
