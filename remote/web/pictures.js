// Images of the project, drawn into canvases. They are fetched again when they may have changed; the browser stores none.

const k_again_ms = 2000; // pause after a failed fetch; doubles each time
const k_most_tries = 6;

/** Draws the image at `path` into a canvas. Does nothing if path and `stamp` are the same as before. */
export async function show_picture(canvas, path, stamp = "") {
  const wanted = `${path} ${stamp}`;
  if (canvas.wanted === wanted) return;
  canvas.wanted = wanted;
  for (let tries = 0; tries < k_most_tries && canvas.wanted === wanted; ++tries) {
    const picture = await fetch_picture(path);
    if (picture && canvas.wanted === wanted) return draw_picture(canvas, picture);
    await new Promise((done) => setTimeout(done, k_again_ms * 2 ** tries));
  }
}

/** Fetches an image of the project; null on failure. */
export async function fetch_picture(path) {
  try {
    const answer = await fetch(path, { cache: "no-store" });
    return answer.ok ? await createImageBitmap(await answer.blob()) : null;
  } catch {
    return null;
  }
}

/** Draws an image into a canvas and gives the canvas its size. */
export function draw_picture(canvas, picture) {
  if (canvas.width !== picture.width || canvas.height !== picture.height) {
    canvas.width = picture.width;
    canvas.height = picture.height;
  }
  canvas.getContext("2d").drawImage(picture, 0, 0);
  picture.close();
  canvas.classList.add("drawn");
}
