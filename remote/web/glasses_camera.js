// Pictures of the glasses' own camera (WebXR's `camera-access`), from which Limn finds where glasses without a marker are.
import { make_program } from "/mesh_gl.js";

const k_interval_ms = 125; // between two pictures
const k_most_px = 960; // of a picture's longer side
const k_quality = 0.85;
const k_most_waiting = 200_000; // bytes that wait to be sent; with more the network is too slow for another picture
const k_patience = 30; // frames without a camera after which there is none

const k_vertex = `#version 300 es
out vec2 v_uv;
void main() {
  v_uv = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  gl_Position = vec4(2.0 * v_uv - 1.0, 0, 1);
}`;
// The picture's first row is the texture's last one.
const k_fragment = `#version 300 es
precision highp float;
uniform sampler2D u_texture;
in vec2 v_uv;
out vec4 o_colour;
void main() { o_colour = texture(u_texture, vec2(v_uv.x, 1.0 - v_uv.y)); }`;

/** The lens [fx, fy, cx, cy] of a picture, px, by the view's projection matrix. Pixel (0, 0) is the first one's centre. */
export function lens_of(projection, width, height) {
  return [
    (width / 2) * projection[0],
    (height / 2) * projection[5],
    (width / 2) * (1 - projection[8]) - 0.5,
    (height / 2) * (1 + projection[9]) - 0.5,
  ];
}

export class GlassesCamera {
  #gl;
  #binding;
  #program;
  #array;
  #frame;
  #texture;
  #size = [0, 0];
  #canvas = document.createElement("canvas");
  #taken_at = -Infinity;
  #is_encoding = false;
  #number = 0;
  #without = 0; // frames in turn without a camera

  /** Whether the browser gives the camera's pictures in this session, as far as it says. */
  static is_granted(xr) {
    return Boolean(xr.enabledFeatures?.includes("camera-access") && window.XRWebGLBinding?.prototype.getCameraImage);
  }

  constructor(xr, gl) {
    this.#gl = gl;
    this.#binding = new XRWebGLBinding(xr, gl);
    this.#program = make_program(gl, k_vertex, k_fragment);
    this.#array = gl.createVertexArray();
    this.#frame = gl.createFramebuffer();
    this.#texture = gl.createTexture();
  }

  /** Whether frames have no camera, against what the browser says. */
  get is_missing() {
    return this.#without >= k_patience;
  }

  /**
   * Takes a picture if it is time to: `pose` is the viewer's. Calls `send` later with the message glasses_view, without its moment,
   * and with the picture as a binary message. Returns whether it takes one.
   */
  take(time, pose, send) {
    const view = pose.views.find(({ camera }) => camera);
    this.#without = view ? 0 : this.#without + 1;
    if (!view || this.#is_encoding || time - this.#taken_at < k_interval_ms) return false;
    const texture = this.#binding.getCameraImage(view.camera);
    if (!texture) return false;
    this.#taken_at = time;
    const scale = Math.min(1, k_most_px / Math.max(view.camera.width, view.camera.height)),
      width = Math.round(scale * view.camera.width),
      height = Math.round(scale * view.camera.height);
    this.#copy(texture, width, height);
    const { orientation: q, position: p } = view.transform;
    const message = {
      type: "glasses_view",
      picture: (this.#number = (this.#number + 1) >>> 0),
      rotation_wxyz: [q.w, q.x, q.y, q.z].map((value) => Number(value.toFixed(7))),
      translation_m: [p.x, p.y, p.z].map((value) => Number(value.toFixed(6))),
      width,
      height,
      lens_px: lens_of(view.projectionMatrix, width, height).map((value) => Number(value.toFixed(3))),
    };
    this.#is_encoding = true;
    this.#encode(message, send).finally(() => (this.#is_encoding = false));
    return true;
  }

  static may_send(bytes_waiting) {
    return bytes_waiting < k_most_waiting;
  }

  close() {
    this.#gl.deleteTexture(this.#texture);
    this.#gl.deleteFramebuffer(this.#frame);
  }

  // Draws the camera's texture at the picture's size, and reads it into the canvas.
  #copy(texture, width, height) {
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#frame);
    if (this.#size[0] !== width || this.#size[1] !== height) {
      this.#size = [width, height];
      gl.bindTexture(gl.TEXTURE_2D, this.#texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.#texture, 0);
      Object.assign(this.#canvas, { width, height });
    }
    gl.viewport(0, 0, width, height);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    gl.useProgram(this.#program);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.LINEAR);
    for (const name of ["TEXTURE_WRAP_S", "TEXTURE_WRAP_T"]) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.CLAMP_TO_EDGE);
    gl.uniform1i(gl.getUniformLocation(this.#program, "u_texture"), 0);
    gl.bindVertexArray(this.#array);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    const pixels = new ImageData(width, height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(pixels.data.buffer));
    this.#canvas.getContext("2d", { alpha: false }).putImageData(pixels, 0, 0);
  }

  async #encode(message, send) {
    const jpeg = await new Promise((done) => this.#canvas.toBlob(done, "image/jpeg", k_quality));
    if (!jpeg) return;
    const bytes = new Uint8Array(4 + jpeg.size);
    new DataView(bytes.buffer).setUint32(0, message.picture, true);
    bytes.set(new Uint8Array(await jpeg.arrayBuffer()), 4);
    send(message, bytes.buffer);
  }
}
