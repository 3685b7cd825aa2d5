// Keeps a page that `meshconv3d page` has made for visits without a network. The command writes
// `build` before this: `shell`, the files that the page begins with, and `versions`, one in the
// address of each file that is kept once it was loaded. All names but that of the page change with
// the content.

const CACHE = `meshconv3d ${registration.scope}`;
const PAGE = "./";
// Without an answer for so long, the page is that of before; in milliseconds.
const PATIENCE = 4000;

const addressOf = (path) => new URL(path, registration.scope).href;

addEventListener("install", (event) => event.waitUntil(keepShell()));
addEventListener("activate", (event) => event.waitUntil(forgetOthers().then(() => clients.claim())));
addEventListener("fetch", (event) => {
  const { request } = event;
  if (request.method !== "GET" || !request.url.startsWith(registration.scope)) return;
  event.respondWith(request.mode === "navigate" ? page(request) : kept(request));
});

async function keepShell() {
  const cache = await caches.open(CACHE);
  for (const path of build.shell) {
    if (!(await cache.match(addressOf(path)))) await cache.add(addressOf(path));
  }
  // Last: what it names is there.
  await cache.put(addressOf(PAGE), await whole(addressOf(PAGE), { cache: "no-cache" }));
}

/** Delete what is of an earlier build. */
async function forgetOthers() {
  const cache = await caches.open(CACHE);
  const known = new Set([PAGE, ...build.shell].map(addressOf));
  for (const { url } of await cache.keys()) {
    const version = new URL(url).searchParams.get("v");
    if (!known.has(url) && !build.versions.includes(version)) await cache.delete(url);
  }
}

/** The newest page, or, without a network, that of before. */
async function page(request) {
  const cache = await caches.open(CACHE);
  try {
    const signal = AbortSignal.timeout(PATIENCE);
    return await whole(request.url, { cache: "no-cache", signal });
  } catch (error) {
    const before = await cache.match(addressOf(PAGE));
    if (before) return before;
    throw error;
  }
}

async function kept(request) {
  const cache = await caches.open(CACHE);
  const found = await cache.match(request);
  if (found) return found;
  const response = await fetch(request);
  if (response.status === 200) {
    const copy = response.clone();
    // A full disk is no reason to go without.
    cache.put(request, copy).catch(() => {});
  }
  return response;
}

async function whole(url, options) {
  const response = await fetch(url, options);
  if (!response.ok) throw new Error(`HTTP status ${response.status}`);
  return response;
}
