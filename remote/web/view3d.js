// An interactive 3D view of the parts in WebGL 2; it is drawn only after a change.
import { bind_cut, Caps, k_cut, k_cut_inputs } from "/cut.js";
import { product } from "/glb.js";
import { delete_mesh, make_pass, upload_mesh } from "/mesh_gl.js";
import { bind_material, k_material, k_material_inputs } from "/mesh_material.js";

const k_vertex = `#version 300 es
uniform mat4 u_view_from_model, u_clip_from_view;
in vec3 a_position;
out vec3 v_position;
${k_material_inputs}
${k_cut_inputs}
void main() {
  pass_cut(a_position);
  vec4 p_view = u_view_from_model * vec4(a_position, 1);
  v_position = p_view.xyz;
  pass_material(mat3(u_view_from_model));
  gl_Position = u_clip_from_view * p_view;
}`;
const k_fragment = `#version 300 es
precision highp float;
uniform float u_glow;
in vec3 v_position;
out vec4 o_colour;
${k_material}
${k_cut}
void main() {
  vec3 cap = cap_colour();
  if (is_cut_away()) discard;
  vec3 linear = u_is_cap ? cap : material_light(material_texel(), normalize(-v_position));
  linear += u_glow * vec3(0.35, 0.2, 0.04);
  o_colour = vec4(pow(linear, vec3(1.0 / 2.2)), 1);
}`;
const k_fov = (35 * Math.PI) / 180;

function box_of(meshes) {
  const low = [Infinity, Infinity, Infinity],
    high = [-Infinity, -Infinity, -Infinity];
  for (const { matrix, positions } of meshes)
    for (let i = 0; i < positions.length; i += 3)
      for (let k = 0; k < 3; ++k) {
        const p =
          matrix[k] * positions[i] +
          matrix[4 + k] * positions[i + 1] +
          matrix[8 + k] * positions[i + 2] +
          matrix[12 + k];
        low[k] = Math.min(low[k], p);
        high[k] = Math.max(high[k], p);
      }
  return {
    centre: low.map((v, k) => (v + high[k]) / 2),
    radius: Math.hypot(...low.map((v, k) => high[k] - v)) / 2 || 1,
  };
}

function perspective(aspect, near, far) {
  const f = 1 / Math.tan(k_fov / 2);
  return new Float32Array([
    f / Math.max(aspect, 1),
    0,
    0,
    0,
    0,
    f * Math.min(aspect, 1),
    0,
    0,
    0,
    0,
    (far + near) / (near - far),
    -1,
    0,
    0,
    (2 * far * near) / (near - far),
    0,
  ]);
}

/** A 3D view of meshes in a canvas; turned and zoomed by dragging, two fingers, the wheel and keys. Throws without WebGL 2. */
export class View3d {
  #gl;
  #pass;
  #caps;
  #canvas;
  #parts = []; // lists of the meshes of each node
  #box = { centre: [0, 0, 0], radius: 1 };
  #yaw = 0.6;
  #pitch = 0.35;
  #near = 1; // zoom factor; above 1 is nearer
  #fingers = new Map();
  #is_due = false;
  #marked = "";

  constructor(canvas) {
    this.#canvas = canvas;
    this.#gl = canvas.getContext("webgl2", { antialias: true, stencil: true });
    if (!this.#gl) throw new Error("This browser has no WebGL 2. Looks are shown as images only.");
    this.#pass = make_pass(this.#gl, k_vertex, k_fragment);
    this.#caps = new Caps(this.#gl, make_pass);
    new ResizeObserver(() => this.#due()).observe(canvas);
    this.#listen();
  }

  show(meshes) {
    for (const part of this.#parts) {
      this.#caps.forget(part);
      for (const mesh of part) delete_mesh(this.#gl, mesh);
    }
    const uploaded = meshes.map((mesh) => upload_mesh(this.#gl, mesh)),
      names = [...new Set(meshes.map(({ name }) => name))];
    this.#parts = names.map((name) => uploaded.filter((mesh) => mesh.name === name));
    this.#box = box_of(meshes);
    this.#due();
  }

  /** Highlights the meshes of this name; empty: none. */
  mark(name) {
    this.#marked = name;
    this.#due();
  }

  #listen() {
    const canvas = this.#canvas;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.#fingers.set(event.pointerId, event);
    });
    canvas.addEventListener("pointermove", (event) => this.#drag(event));
    for (const end of ["pointerup", "pointercancel"])
      canvas.addEventListener(end, (event) => this.#fingers.delete(event.pointerId));
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.#turn(0, 0, Math.exp(-event.deltaY / 600));
      },
      { passive: false },
    );
    const keys = {
      ArrowLeft: [-0.15, 0, 1],
      ArrowRight: [0.15, 0, 1],
      ArrowUp: [0, 0.15, 1],
      ArrowDown: [0, -0.15, 1],
      "+": [0, 0, 1.15],
      "=": [0, 0, 1.15],
      "-": [0, 0, 1 / 1.15],
    };
    canvas.addEventListener("keydown", (event) => {
      if (!keys[event.key]) return;
      event.preventDefault();
      this.#turn(...keys[event.key]);
    });
  }

  #drag(event) {
    const before = this.#fingers.get(event.pointerId);
    if (!before) return;
    const other = [...this.#fingers.values()].find((finger) => finger.pointerId !== event.pointerId);
    const apart = (finger) => Math.hypot(finger.clientX - other.clientX, finger.clientY - other.clientY) || 1;
    this.#fingers.set(event.pointerId, event);
    if (other) this.#turn(0, 0, apart(event) / apart(before));
    else this.#turn((before.clientX - event.clientX) / 150, (event.clientY - before.clientY) / 150, 1);
  }

  #turn(yaw, pitch, nearer) {
    this.#yaw += yaw;
    this.#pitch = Math.min(Math.max(this.#pitch + pitch, -1.55), 1.55);
    this.#near = Math.min(Math.max(this.#near * nearer, 0.4), 8);
    this.#due();
  }

  #due() {
    if (this.#is_due) return;
    this.#is_due = true;
    requestAnimationFrame(() => {
      this.#is_due = false;
      this.#draw();
    });
  }

  #view_from_world() {
    const [cy, sy, cp, sp] = [Math.cos(this.#yaw), Math.sin(this.#yaw), Math.cos(this.#pitch), Math.sin(this.#pitch)];
    const { centre, radius } = this.#box,
      away = radius / Math.sin(k_fov / 2) / this.#near;
    const turned = new Float32Array([
      cy,
      -sp * sy,
      cp * sy,
      0,
      0,
      cp,
      sp,
      0,
      -sy,
      -sp * cy,
      cp * cy,
      0,
      0,
      0,
      -away,
      1,
    ]);
    const moved = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -centre[0], -centre[1], -centre[2], 1]);
    return [product(turned, moved), away];
  }

  #draw() {
    const gl = this.#gl,
      canvas = this.#canvas,
      dense = Math.min(devicePixelRatio, 2);
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * dense));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * dense));
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.03, 0.03, 0.035, 1);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    const { program, at } = this.#pass;
    gl.useProgram(program);
    const [view_from_world, away] = this.#view_from_world(),
      { radius } = this.#box;
    const near = Math.max(away - 1.1 * radius, 0.01 * radius),
      clip_from_view = perspective(canvas.width / canvas.height, near, away + 1.1 * radius);
    gl.uniformMatrix4fv(at("u_clip_from_view"), false, clip_from_view);
    for (const part of this.#parts) {
      const [{ name, cut, matrix }] = part,
        view_from_model = product(view_from_world, matrix);
      gl.uniformMatrix4fv(at("u_view_from_model"), false, view_from_model);
      gl.uniform1f(at("u_glow"), this.#marked && name === this.#marked ? 1 : 0);
      bind_cut(gl, at, cut);
      for (const mesh of part) {
        bind_material(gl, at, mesh);
        gl.bindVertexArray(mesh.array);
        gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
      }
      if (!cut) continue;
      this.#caps.draw(part, product(clip_from_view, view_from_model), cut, () => {
        gl.useProgram(program);
        return at;
      });
    }
    canvas.dataset.meshes = this.#parts.flat().length;
  }
}
