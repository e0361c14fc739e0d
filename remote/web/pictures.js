// Pictures of the project, drawn into canvases: fetched anew when they may differ, none kept by the browser.

const k_again_ms = 2000; // after a picture that could not be had; twice as long each time
const k_most_tries = 6;

/** Draws what `path` gives into a canvas. A `stamp` that has not changed asks for nothing. */
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

/** A picture of the project; null when it cannot be had. */
export async function fetch_picture(path) {
  try {
    const answer = await fetch(path, { cache: "no-store" });
    return answer.ok ? await createImageBitmap(await answer.blob()) : null;
  } catch {
    return null;
  }
}

/** Gives a canvas the picture's size and pixels. */
export function draw_picture(canvas, picture) {
  if (canvas.width !== picture.width || canvas.height !== picture.height) {
    canvas.width = picture.width;
    canvas.height = picture.height;
  }
  canvas.getContext("2d").drawImage(picture, 0, 0);
  picture.close();
  canvas.classList.add("drawn");
}
