// Makes the page installable as a web app. It caches nothing; while Limn cannot be reached it shows a page that says so.
const k_words = `<!doctype html><html lang="en"><meta charset="utf-8"><title>Limn</title>
<meta name="viewport" content="width=device-width"><meta name="color-scheme" content="dark">
<body bgcolor="#0b0b0d" text="#edeae4"><center><font face="system-ui"><br><br><h1>Limn is not there</h1>
<p>Is it running, and are you on its network?</p><p><a href=""><font color="#ffc46b">Try again</font></a></p></font></center>`;

self.addEventListener("install", () => self.skipWaiting());
self.addEventListener("activate", (event) => event.waitUntil(self.clients.claim()));
self.addEventListener("fetch", (event) => {
  if (event.request.mode !== "navigate") return;
  event.respondWith(
    fetch(event.request).catch(
      () => new Response(k_words, { headers: { "Content-Type": "text/html; charset=utf-8" } }),
    ),
  );
});
