// Pictures of the project, drawn into canvases: fetched anew when they may differ, none kept by the browser.

const k_again_ms = 3000; // after a picture that could not be had

/** Draws what `path` gives into a canvas. A `stamp` that has not changed asks for nothing. */
export async function show_picture(canvas, path, stamp = "") {
  const wanted = `${path} ${stamp}`;
  if (canvas.wanted === wanted) return;
  canvas.wanted = wanted;
  try {
    const answer = await fetch(path, { cache: "no-store" });
    if (!answer.ok) throw new Error(answer.status);
    const picture = await createImageBitmap(await answer.blob());
    if (canvas.wanted === wanted) draw_picture(canvas, picture);
  } catch {
    if (canvas.wanted === wanted)
      setTimeout(() => canvas.wanted === wanted && (canvas.wanted = undefined), k_again_ms);
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
