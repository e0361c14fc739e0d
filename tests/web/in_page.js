// Runs in each page before its own code. Records the WebSocket's messages, and offers measurements of the page to the tests as
// functions of window.limn_test.
(() => {
  const k_kept = 12; // number of recorded frames and answers of the window
  const k_drawn = 12; // least difference, in levels, between a part and its background
  const frames = [],
    answers = [],
    states = [],
    sockets = [];
  const Native = WebSocket;
  window.WebSocket = class extends Native {
    constructor(...given) {
      super(...given);
      sockets.push(this);
      this.addEventListener("message", (event) => {
        const { data } = event;
        if (window.limn_test.is_deaf && event.isTrusted) return event.stopImmediatePropagation();
        if (data instanceof ArrayBuffer) {
          if (new DataView(data).getUint32(0, true) === 2)
            answers.splice(0, answers.length, ...answers.slice(1 - k_kept), data);
          return;
        }
        const { type, number, last_edit } = JSON.parse(data);
        if (type === "state") states.push({ at: performance.timeOrigin + performance.now(), number, last_edit });
      });
    }
    send(data) {
      if (data instanceof ArrayBuffer) frames.splice(0, frames.length, ...frames.slice(1 - k_kept), data);
      super.send(data);
    }
  };

  const all = (selector) => [...document.querySelectorAll(selector)].filter((node) => node.checkVisibility());
  const controls = () => all("button, a[href], select, input").filter((node) => !node.disabled);
  const in_words = (node) => node.outerHTML.slice(0, 120);

  // Relative luminance of a colour as in WCAG, plus 0.05: from 0.05 to 1.05.
  const linear = (v) => (v <= 10 ? v / 3294.6 : ((v / 255 + 0.055) / 1.055) ** 2.4);
  const light = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b) + 0.05;
  const numbers = (text) => text.match(/[\d.]+/g).map(Number);
  const ground = (node) => {
    for (; node; node = node.parentElement) {
      const colour = numbers(getComputedStyle(node).backgroundColor);
      if (colour.length < 4 || colour[3] > 0.5) return colour;
    }
    return [255, 255, 255];
  };
  const has_text = (node) =>
    [...node.childNodes].some((child) => child.nodeType === Node.TEXT_NODE && child.textContent.trim());

  const colours = (picture, width, height) => {
    const context = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
    context.drawImage(picture, 0, 0, width, height);
    return context.getImageData(0, 0, width, height).data;
  };
  const grey = (picture, width, height) => {
    const data = colours(picture, width, height);
    return Array.from({ length: width * height }, (_, i) => (data[4 * i] + data[4 * i + 1] + data[4 * i + 2]) / 3);
  };
  const bitmap = (bytes, type) => createImageBitmap(new Blob([bytes], { type }));
  const bytes_of = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const apart = (a, b) => a.reduce((sum, value, i) => sum + Math.abs(value - b[i]), 0) / a.length;
  const small = (picture) => grey(picture, 64, 48);
  const median = (values) => values.sort((x, y) => x - y)[values.length >> 1] ?? NaN;
  let film = [];

  // Intersection over union of two masks, the second one moved by (dx, dy).
  const overlap = (one, two, width, height, dx, dy) => {
    const margin = 8;
    let both = 0,
      either = 0;
    for (let y = margin; y < height - margin; ++y)
      for (let x = margin; x < width - margin; ++x) {
        const a = one[y * width + x],
          b = two[(y + dy) * width + x + dx];
        both += a && b;
        either += a || b;
      }
    return either ? both / either : 0;
  };

  // Distance, in mask pixels, by which one mask must be moved for the best overlap; sub-pixel by fitting a parabola.
  const offset = (one, two, width, height) => {
    const shared = (dx, dy) => overlap(one, two, width, height, dx, dy);
    let [x, y, best] = [0, 0, 0];
    for (let dy = -4; dy <= 4; ++dy)
      for (let dx = -4; dx <= 4; ++dx) {
        const found = shared(dx, dy);
        if (found > best) [x, y, best] = [dx, dy, found];
      }
    const peak = (low, high) => (low - high) / 2 / (low - 2 * best + high);
    return Math.hypot(x + peak(shared(x - 1, y), shared(x + 1, y)), y + peak(shared(x, y - 1), shared(x, y + 1)));
  };

  window.limn_test = {
    is_deaf: false, // whether the page ignores messages from the WebSocket
    frames,
    answers,
    states,
    sockets,

    unnamed: () =>
      controls()
        .filter((n) => !(n.getAttribute("aria-label") || n.textContent.trim() || n.labels?.length))
        .map(in_words),

    // Starts to record the focus; missed() then lists the controls that the Tab key has not reached.
    watch_focus() {
      const seen = new Set();
      addEventListener("focusin", (event) => seen.add(event.target));
      document.activeElement?.blur();
      const wanted = controls();
      this.missed = () =>
        wanted.filter((node) => node.isConnected && node.checkVisibility() && !seen.has(node)).map(in_words);
      return wanted.length;
    },

    small_targets: (least) =>
      all("button, a[href], select, input:not([type=range])")
        .map((node) => [in_words(node), node.getBoundingClientRect()])
        .filter(([, box]) => Math.min(box.width, box.height) < least - 0.5)
        .map(([words, box]) => `${words} ${box.width}x${box.height}`),

    sticking_out: () =>
      all("#session *")
        .filter((node) => !node.closest(".strip, .looks, svg, video"))
        .filter((node) => {
          const { left, right } = node.getBoundingClientRect();
          return left < -1 || right > innerWidth + 1;
        })
        .map(in_words),

    faint_text: (least) =>
      all("body *")
        .filter(has_text)
        .map((node) => [in_words(node), light(numbers(getComputedStyle(node).color)), light(ground(node))])
        .filter(([, one, two]) => Math.max(one, two) / Math.min(one, two) < least)
        .map(([words]) => words),

    // A canvas as a small grey image.
    pixels: (selector) => small(document.querySelector(selector)),

    // A projector's image, likewise.
    async projector(name) {
      const answer = await fetch(`/picture/projector/${name}.jpg`);
      return small(await createImageBitmap(await answer.blob()));
    },

    // Stores the views of the film: each has an image (JPEG) and the mask of the part in it (PNG), in base64.
    async keep_film(views) {
      film = await Promise.all(
        views.map(async ({ picture, part }) => {
          const mask = await bitmap(bytes_of(part), "image/png"),
            { width, height } = mask;
          return {
            small: small(await bitmap(bytes_of(picture), "image/jpeg")),
            part: grey(mask, width, height).map((v) => Number(v > 127)),
            width,
            height,
          };
        }),
      );
    },

    // Compares each answer's image with the frame of its number, and the part drawn in it with the true mask of that view.
    // Returns counts, and medians over the answers.
    async window_measured() {
      const window_picture = document.querySelector("#window-picture");
      const shown = { number: Number(window_picture.dataset.number), small: small(window_picture) };
      const sent = new Map();
      for (const data of frames)
        sent.set(new DataView(data).getUint32(0, true), await bitmap(data.slice(4), "image/jpeg"));
      const out = { answers: 0, belong: 0, is_shown: false },
        offs = [],
        overlaps = [],
        views = new Set();
      for (const data of answers) {
        const head = new DataView(data),
          number = head.getUint32(4, true),
          length = head.getUint32(8, true);
        const json = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 12, length))),
          frame = sent.get(number);
        if (!frame || json.sees === "nothing") continue;
        const answer = await bitmap(new Uint8Array(data, 12 + length), "image/jpeg"),
          seen = small(answer);
        ++out.answers;
        if (number === shown.number) out.is_shown = apart(seen, shown.small) < 1;
        out.belong += [...sent.values()].every(
          (other) => apart(seen, small(frame)) <= apart(seen, small(other)) + 0.5,
        );
        const view = film.reduce((best, one) =>
          apart(one.small, small(frame)) < apart(best.small, small(frame)) ? one : best,
        );
        const { width, height } = view,
          a = colours(answer, width, height),
          b = colours(frame, width, height);
        const drawn = view.part.map((_, i) =>
          Number([0, 1, 2].some((k) => Math.abs(a[4 * i + k] - b[4 * i + k]) > k_drawn)),
        );
        offs.push((offset(drawn, view.part, width, height) * frame.width) / width);
        overlaps.push(overlap(drawn, view.part, width, height, 0, 0));
        views.add(view);
        const { rms_px, lens, ms } = json,
          limn_ms = Object.values(ms).reduce((sum, one) => sum + one, 0);
        Object.assign(out, {
          rms_px,
          limn_ms,
          focal_px: lens.values[0],
          focal_stddev_px: lens.focal_stddev_px,
          lens_frames: lens.frames,
          width: frame.width,
        });
      }
      return Object.assign(out, { off_px: median(offs), overlap: median(overlaps), views: views.size });
    },
  };
})();
