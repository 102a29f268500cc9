// Keeps the files of the page, so that it also works without a network. An open page keeps its own
// version: a newer one waits until no page is open, for it cannot run with files of another one.

const CACHE = "penup-/* STAMP */";
const FILES = ["./"].concat([/* FILES */]);

self.addEventListener("install", (event) => {
  // What the browser has kept by itself may be older.
  const files = FILES.map((file) => new Request(file, { cache: "reload" }));
  event.waitUntil(caches.open(CACHE).then((cache) => cache.addAll(files)));
});
self.addEventListener("activate", (event) => {
  const old = (name) => name.startsWith("penup-") && name !== CACHE;
  event.waitUntil(
    caches
      .keys()
      .then((names) => Promise.all(names.filter(old).map((name) => caches.delete(name))))
      .then(() => self.clients.claim()),
  );
});
self.addEventListener("fetch", (event) => {
  if (event.request.method !== "GET") return;
  event.respondWith(
    caches
      .open(CACHE)
      .then((cache) => cache.match(event.request, { ignoreSearch: true }))
      .then((kept) => kept ?? fetch(event.request)),
  );
});
