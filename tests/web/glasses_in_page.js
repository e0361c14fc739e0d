// Runs before the page, after iwer: emulated glasses, and what the tests ask of them. Time stands still for them between two
// calls of step(): a frame is drawn when one is asked for, so that a slow machine measures the same as a fast one.
(() => {
  const native_frame = window.requestAnimationFrame.bind(window);
  const k_clock_offset_s = 1234.5; // of the page's clock against the session's
  let path = null, // of web_glasses_room
    clock_s = k_clock_offset_s,
    device_frame = null, // iwer's next frame
    xr = null,
    layer = null,
    gl = null,
    camera_texture = null,
    photograph = null; // what the glasses' camera sees in the next frame, as an ImageBitmap whose last row comes first
  const k_camera = { width: 960, height: 960 };
  const traffic = { frames: 0, sent: 0, pictures: 0, others: 0, largest: { glasses: 0, glasses_parts: 0 } }, // bytes
    places = [];

  const device = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: true, fovy: (55 * Math.PI) / 180, ipd: 0.063 });
  device.installRuntime({ forceInstall: true });

  // The things that the device's depth sensor measures: a far wall, and a hand while it is held up.
  class Things {
    environmentCanvas = document.createElement("canvas");
    hand = null;
    render() {}
    computeDepthBuffer(view, projection, width, height) {
      const data = new Float32Array(width * height).fill(9);
      for (let row = 0; row < height * (this.hand?.bottom ?? 0); ++row)
        data.fill(0.25, row * width, row * width + Math.round(width * this.hand.right));
      return { data: data.buffer, width, height, rawValueToMeters: 1 };
    }
  }
  device.installSEM(Things);
  const granted = { depth_usage: "cpu-optimized", features: ["local-floor", "hand-tracking"] };

  // Where the odometry believes the head to be at a moment of the walk.
  const move_to = (at_s) => {
    const at = Math.min(Math.max(at_s / path.step_s, 0), path.poses.length - 1.001),
      i = Math.floor(at),
      share = at - i;
    const [a, b] = [path.poses[i], path.poses[i + 1]],
      mixed = a.map((value, k) => value * (1 - share) + b[k] * share);
    const length = Math.hypot(...mixed.slice(0, 4));
    device.quaternion.set(...[1, 2, 3, 0].map((k) => mixed[k] / length));
    device.position.set(...mixed.slice(4));
  };
  // iwer's frames wait for draw_frame(); others, of the page itself, are drawn as always.
  window.requestAnimationFrame = (callback) => {
    if (callback.name !== "onDeviceFrame") return native_frame(callback);
    device_frame = callback;
    return -1;
  };
  // Draws a frame, whose time iwer gets from performance.now().
  const draw_frame = () =>
    new Promise((done) =>
      native_frame(() => {
        const draw = device_frame,
          time = 1000 * clock_s;
        device_frame = null;
        performance.now = () => time;
        try {
          draw?.(time);
        } finally {
          delete performance.now;
        }
        ++traffic.frames;
        done();
      }),
    );

  const request = navigator.xr.requestSession.bind(navigator.xr);
  navigator.xr.requestSession = async (mode, options) => {
    const gives_depth = options.depthSensing.usagePreference.includes(granted.depth_usage);
    const features = options.optionalFeatures.filter((name) => granted.features.includes(name));
    const has_camera = options.optionalFeatures.includes("camera-access") && granted.features.includes("camera-access");
    xr = await request(mode, {
      optionalFeatures: (gives_depth ? [...features, "depth-sensing"] : features).filter((name) => name !== "camera-access"),
      depthSensing: { ...options.depthSensing, usagePreference: [granted.depth_usage] },
    });
    if (has_camera) xr.enabledFeatures.push("camera-access");
    places.length = 0;
    device.sem.hand = null;
    return xr;
  };
  // The camera is at the left eye, with its lens. A frame without a new photograph has no image of it.
  Object.defineProperty(XRView.prototype, "camera", {
    get() {
      return xr?.enabledFeatures.includes("camera-access") && this.eye !== "right" ? k_camera : undefined;
    },
  });
  XRWebGLBinding.prototype.getCameraImage = () => {
    if (!photograph) return null;
    camera_texture ??= gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, camera_texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, photograph);
    gl.bindTexture(gl.TEXTURE_2D, null);
    photograph = null;
    return camera_texture;
  };
  const Layer = window.XRWebGLLayer;
  window.XRWebGLLayer = class extends Layer {
    constructor(session, context, options) {
      super(session, context, options);
      [layer, gl] = [this, context];
    }
  };
  const Socket = window.WebSocket;
  window.WebSocket = class extends Socket {
    constructor(...given) {
      super(...given);
      this.addEventListener("message", ({ data }) => {
        const message = typeof data === "string" ? JSON.parse(data) : { type: "image" };
        const bytes = data.length ?? data.byteLength;
        if (message.type in traffic.largest) traffic.largest[message.type] = Math.max(traffic.largest[message.type], bytes);
        else traffic.others += bytes;
        if (message.type === "glasses") places.push(message);
      });
    }
    send(data) {
      traffic.sent += data.length ?? data.byteLength;
      traffic.pictures += typeof data !== "string";
      super.send(data);
    }
  };

  const digits = "0123456789abcdef";
  window.limn_glasses = {
    device,
    places,
    set_path: (given) => {
      path = given;
    },
    // The session's clock is now_s, and the person is at at_s of the walk. Returns the newest state that the page was told.
    async step(now_s, at_s) {
      clock_s = now_s + k_clock_offset_s;
      move_to(at_s);
      await draw_frame();
      return places.at(-1)?.state ?? "none";
    },
    traffic: () => structuredClone(traffic),
    // A step in which the glasses' camera takes this photograph (base64 of a PNG). Returns the state and whether its
    // picture was sent.
    async step_with_photograph(now_s, at_s, png) {
      const bytes = Uint8Array.from(atob(png), (letter) => letter.charCodeAt(0));
      const how = { imageOrientation: "flipY", colorSpaceConversion: "none" };
      photograph = await createImageBitmap(new Blob([bytes], { type: "image/png" }), how);
      const before = traffic.pictures;
      const state = await this.step(now_s, at_s);
      const is_taken = photograph === null;
      photograph = null;
      for (let i = 0; is_taken && traffic.pictures === before && i < 300; ++i) await new Promise((done) => setTimeout(done, 10));
      return { state, is_sent: traffic.pictures > before };
    },

    // The pixels of each eye that the page draws in a frame, as web_glasses_room's masks, first row first.
    capture: () =>
      new Promise((done) => {
        xr.requestAnimationFrame((time, frame) => {
          const eyes = [];
          for (const view of layer_views(frame)) {
            const { x, y, width, height } = layer.getViewport(view);
            if (!width) continue;
            const pixels = new Uint8Array(4 * width * height);
            gl.bindFramebuffer(gl.FRAMEBUFFER, layer.framebuffer);
            gl.readPixels(x, y, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
            let bits = "";
            for (let row = height - 1; row >= 0; --row)
              for (let column = 0; column < width; column += 4) {
                let digit = 0;
                for (let k = 0; k < 4; ++k) digit = 2 * digit + (pixels[4 * (row * width + column + k) + 3] > 127);
                bits += digits[digit];
              }
            const { orientation: q, position: p } = view.transform;
            const feed_from_view = [q.w, q.x, q.y, q.z, p.x, p.y, p.z];
            const { world_from_feed } = places.at(-1);
            eyes.push({ width, height, bits, eye: view.eye, projection: [...view.projectionMatrix], feed_from_view, world_from_feed });
          }
          done(eyes);
        });
        draw_frame();
      }),
    // The left hand stands before the face.
    raise_a_hand() {
      device.primaryInputMode = "hand";
      const hand = device.hands.left;
      hand.connected = true;
      device.hands.right.connected = false;
      const forward = new DOMPoint(-0.06, 0, -0.35, 1),
        { x, y, z, w } = device.quaternion;
      const turned = (p) => {
        const c = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        const v = [p.x, p.y, p.z],
          t = c([x, y, z], v).map((value) => 2 * value);
        const u = c([x, y, z], t);
        return v.map((value, k) => value + w * t[k] + u[k]);
      };
      const [dx, dy, dz] = turned(forward);
      hand.position.set(device.position.x + dx, device.position.y + dy, device.position.z + dz);
      const [sine, cosine] = [Math.sin(0.6), Math.cos(0.6)]; // the fingers point up
      hand.quaternion.set(
        x * cosine + w * sine,
        y * cosine + z * sine,
        z * cosine - y * sine,
        w * cosine - x * sine,
      );
    },
    // What this browser grants: the usage of depth, or "none"; and other features.
    grant(depth_usage, features) {
      granted.depth_usage = depth_usage;
      granted.features = features;
    },
    // From now on the device measures a hand near the eyes, from the upper left corner of each image to these shares of it.
    hold_a_hand_up(right, bottom) {
      device.sem.hand = { right, bottom };
    },
    // From now on depth comes as phones give it: a texture of two bytes a pixel, here mirrored.
    give_depth_as_phones_do() {
      Object.defineProperty(xr, "depthDataFormat", { configurable: true, value: "luminance-alpha" });
      const mirrored = new Float32Array([-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1]);
      const texture = gl.createTexture();
      XRWebGLBinding.prototype.getDepthInformation = () => {
        const { data, width, height } = device.sem.computeDepthBuffer(null, null, 320, 160);
        const metres = new Float32Array(data),
          bytes = new Uint8Array(2 * width * height);
        metres.forEach((value, i) => {
          const row = Math.floor(i / width),
            column = width - 1 - (i % width),
            raw = Math.round(1000 * value);
          bytes.set([raw % 256, raw >> 8], 2 * (row * width + column));
        });
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.LUMINANCE_ALPHA, width, height, 0, gl.LUMINANCE_ALPHA, gl.UNSIGNED_BYTE, bytes);
        for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.NEAREST);
        for (const name of ["TEXTURE_WRAP_S", "TEXTURE_WRAP_T"]) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.CLAMP_TO_EDGE);
        const normDepthBufferFromNormView = { matrix: mirrored };
        return { texture, width, height, normDepthBufferFromNormView, rawValueToMeters: 0.001, textureType: "texture", imageIndex: null };
      };
    },
    hide: (is_hidden) => device.updateVisibilityState(is_hidden ? "hidden" : "visible"),
  };

  let viewer_space = null;
  const layer_views = (frame) => frame.getViewerPose(viewer_space).views;
  const own = XRSession.prototype.requestReferenceSpace;
  XRSession.prototype.requestReferenceSpace = async function (kind) {
    const space = await own.call(this, kind);
    viewer_space = space;
    return space;
  };
})();
