// Keeps the files of a page without a server, so that it opens without a network after the first visit. A file is taken from
// the network first; what was kept serves where there is none.
const STORE = "palpate";

self.addEventListener("install", () => self.skipWaiting());
self.addEventListener("activate", (event) => event.waitUntil(self.clients.claim()));
self.addEventListener("fetch", (event) => {
  if (event.request.method !== "GET" || new URL(event.request.url).origin !== self.location.origin) return;
  event.respondWith(fromNetwork(event.request));
});
// What the page had fetched before this worker was there.
self.addEventListener("message", (event) => {
  event.waitUntil(caches.open(STORE).then((store) => Promise.all(event.data.map((url) => store.add(url).catch(() => undefined)))));
});

async function fromNetwork(request) {
  const store = await caches.open(STORE);
  try {
    const answer = await fetch(request);
    if (answer.ok) await store.put(request, answer.clone());
    return answer;
  } catch (error) {
    const kept = await store.match(request, { ignoreSearch: request.mode === "navigate" });
    if (kept) return kept;
    throw error;
  }
}
