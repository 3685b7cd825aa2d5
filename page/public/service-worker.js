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
  if (request.mode !== "navigate") event.respondWith(kept(request));
  else if (isPage(request.url)) event.respondWith(page(request.url));
});

const isPage = (url) => [PAGE, "index.html"].map(addressOf).includes(url.split(/[?#]/)[0]);

/** Whether a file belongs to this build, and not to another page below it. */
function isOurs(url) {
  const version = new URL(url).searchParams.get("v");
  return build.versions.includes(version) || build.shell.map(addressOf).includes(url);
}

async function keepShell() {
  const cache = await caches.open(CACHE);
  for (const url of build.shell.map(addressOf)) {
    if (!(await cache.match(url))) await cache.put(url, await whole(url));
  }
  // Last: what it names is there.
  await cache.put(addressOf(PAGE), await whole(addressOf(PAGE), { cache: "no-cache" }));
}

/** Delete what is of an earlier build. */
async function forgetOthers() {
  const cache = await caches.open(CACHE);
  for (const { url } of await cache.keys()) {
    if (url !== addressOf(PAGE) && !isOurs(url)) await cache.delete(url);
  }
}

/** The newest page, or, without a network, that of before. */
async function page(url) {
  try {
    return await whole(url, { cache: "no-cache", signal: AbortSignal.timeout(PATIENCE) });
  } catch (error) {
    const cache = await caches.open(CACHE);
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
  // A full disk is no reason to go without.
  if (response.status === 200 && isOurs(request.url)) {
    cache.put(request, response.clone()).catch(() => {});
  }
  return response;
}

async function whole(url, options) {
  const response = await fetch(url, options);
  if (!response.ok) throw new Error(`HTTP status ${response.status}`);
  return response;
}
