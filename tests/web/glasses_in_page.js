// Runs before the page, after iwer: emulated glasses that follow a path in time, and what the tests ask of them.
(() => {
  const native_frame = window.requestAnimationFrame.bind(window);
  let path = null, // of web_glasses_room
    walk = { at_unix_s: Infinity, from_s: 0, until_s: 0 },
    xr = null,
    layer = null,
    gl = null;
  const traffic = { frames: 0, sent: 0, received: 0, largest: 0 },
    places = [];

  const device = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: true, fovy: (55 * Math.PI) / 180, ipd: 0.063 });
  device.installRuntime({ forceInstall: true });

  // Where the odometry believes the head to be.
  const move_to = (unix_s) => {
    if (!path) return;
    const at_s = Math.min(Math.max(unix_s - walk.at_unix_s + walk.from_s, walk.from_s), walk.until_s);
    const at = Math.min(at_s / path.step_s, path.poses.length - 1.001),
      i = Math.floor(at),
      share = at - i;
    const [a, b] = [path.poses[i], path.poses[i + 1]],
      mixed = a.map((value, k) => value * (1 - share) + b[k] * share);
    const length = Math.hypot(...mixed.slice(0, 4));
    device.quaternion.set(...[1, 2, 3, 0].map((k) => mixed[k] / length));
    device.position.set(...mixed.slice(4));
  };
  // The head stands where it is at the frame's own time, which iwer gets from performance.now().
  window.requestAnimationFrame = (callback) =>
    native_frame((time) => {
      const now = performance.now();
      move_to((performance.timeOrigin + now) / 1000);
      performance.now = () => now;
      try {
        callback(time);
      } finally {
        delete performance.now;
      }
    });

  const request = navigator.xr.requestSession.bind(navigator.xr);
  navigator.xr.requestSession = async (...given) => {
    xr = await request(...given);
    const count = () => {
      ++traffic.frames;
      xr.requestAnimationFrame(count);
    };
    xr.requestAnimationFrame(count);
    return xr;
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
        const bytes = data.length ?? data.byteLength;
        traffic.received += bytes;
        traffic.largest = Math.max(traffic.largest, bytes);
        if (typeof data !== "string") return;
        const message = JSON.parse(data);
        if (message.type === "glasses") places.push({ unix_s: Date.now() / 1000, ...message });
      });
    }
    send(data) {
      traffic.sent += data.length ?? data.byteLength;
      super.send(data);
    }
  };

  const digits = "0123456789abcdef";
  window.limn_glasses = {
    device,
    places,
    walk_on(given, at_unix_s, from_s, until_s) {
      path = given;
      walk = { at_unix_s, from_s, until_s };
    },
    traffic: () => ({ ...traffic }),

    // The pixels of each eye that the page has drawn in its next frame, as web_glasses_room's masks, first row first.
    capture: () =>
      new Promise((done) =>
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
        }),
      ),
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
    // From now on the device measures a hand near the eye in the left half of each image, and nothing near in the right one.
    hold_a_hand_up() {
      const one = { configurable: true };
      Object.defineProperty(xr, "depthUsage", { ...one, value: "cpu-optimized" });
      Object.defineProperty(xr, "depthDataFormat", { ...one, value: "float32" });
      const matrix = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
      XRFrame.prototype.getDepthInformation = () => ({
        width: 2,
        height: 1,
        data: new Float32Array([250, 9000]).buffer,
        rawValueToMeters: 0.001,
        normDepthBufferFromNormView: { matrix },
      });
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
