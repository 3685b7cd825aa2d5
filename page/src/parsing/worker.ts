// Reads files beside the page, which goes on turning.

import { read } from "./read";

export interface Task {
  id: number;
  name: string;
  data: ArrayBuffer;
  coloured: boolean;
}

self.onmessage = async ({ data: task }: MessageEvent<Task>) => {
  try {
    const shown = await read(task.name, task.data, task.coloured);
    const buffers = [shown.positions.buffer, ...(shown.colours ? [shown.colours.buffer] : [])];
    self.postMessage({ id: task.id, shown }, { transfer: buffers });
  } catch (error) {
    self.postMessage({ id: task.id, error: String(error) });
  }
};
