// The service worker, which keeps the build for visits without a network.

/** Long enough for a page that is opened for the first time. */
const PATIENCE = 3000;

export const isKept = () => Boolean(navigator.serviceWorker?.controller);

/** Resolves once what is loaded is kept, or where nothing can be: over plain HTTP, say. */
export async function keep(): Promise<void> {
  const workers = navigator.serviceWorker;
  if (!workers) return;
  const controlled = new Promise<void>((resolve) => {
    if (workers.controller) resolve();
    workers.addEventListener("controllerchange", () => resolve());
    setTimeout(resolve, PATIENCE);
  });
  await workers.register("service-worker.js").then(() => controlled, () => {});
}
