// Parts that a plane cuts open, in the 3D views. Shaders leave out what lies in front of the plane, and caps close the openings
// of pieces that close, as in Limn's own shaders (projector/cap_counter.h).

const k_margin_m = 1e-5; // what is nearer to the plane counts as removed, as k_cut_margin_m of scene/meshes/closed_pieces.h

/** Vertex shader: `pass_cut(p)` takes a point in the mesh's frame. */
export const k_cut_inputs = `
uniform vec4 u_cut; // height of p over the plane, in the mesh's frame: dot(xyz, p) + w
out vec4 v_cut; // point in the mesh's frame, height
void pass_cut(vec3 p) { v_cut = vec4(p, dot(u_cut.xyz, p) + u_cut.w); }`;

/** Fragment shader: `is_cut_away()`, `u_is_cap`, and `cap_colour()`, linear light, which is to be called before anything is discarded. */
export const k_cut = `
uniform bool u_is_cap;
uniform vec3 u_hatch, u_cap_colour; // the lines' phase is the product of u_hatch with p
uniform vec2 u_line; // width of a line as a share of their distance; its colour as a share of the cap's
in vec4 v_cut;
bool is_cut_away() { return !u_is_cap && v_cut.w > -${k_margin_m.toFixed(6)}; }
vec3 cap_colour() {
  float phase = dot(u_hatch, v_cut.xyz), width = clamp(fwidth(phase), 1e-4, 1e3);
  float from = phase - 0.5 * width, to = phase + 0.5 * width;
  float covered = (floor(to) - floor(from)) * u_line.x + min(fract(to), u_line.x) - min(fract(from), u_line.x);
  return u_cap_colour * mix(1.0, u_line.y, clamp(covered / width, 0.0, 1.0));
}`;

const k_count_vertex = `#version 300 es
uniform mat4 u_clip_from_mesh;
in vec3 a_position;
${k_cut_inputs}
void main() {
  pass_cut(a_position);
  gl_Position = u_clip_from_mesh * vec4(a_position, 1);
}`;
const k_count_fragment = `#version 300 es
precision highp float;
in vec4 v_cut;
out vec4 o_colour;
void main() {
  if (v_cut.w > -${k_margin_m.toFixed(6)}) discard;
  o_colour = vec4(0);
}`;

/**
 * For each mesh of a part its indices without the triangles of pieces that do not close: along each side of a piece that closes its
 * triangles run in one direction as often as in the other. A piece may be of several meshes; corners at the same position count as one.
 */
export function closed_indices(meshes) {
  const places = new Map(), // by position
    triangles = [], // [a, b, c], places
    parents = [];
  for (const { positions, indices } of meshes) {
    const place_of = new Int32Array(positions.length / 3).fill(-1);
    const place = (i) => {
      if (place_of[i] < 0) {
        const key = `${positions[3 * i]} ${positions[3 * i + 1]} ${positions[3 * i + 2]}`;
        if (!places.has(key)) places.set(key, places.size);
        place_of[i] = places.get(key);
      }
      return place_of[i];
    };
    for (let i = 0; i + 2 < indices.length; i += 3) {
      parents.push(triangles.length);
      triangles.push([place(indices[i]), place(indices[i + 1]), place(indices[i + 2])]);
    }
  }
  const piece_of = (triangle) => {
    while (parents[triangle] !== triangle) triangle = parents[triangle] = parents[parents[triangle]];
    return triangle;
  };
  const sides = new Map(); // by their places: {triangle, sum of directions}
  triangles.forEach((corners, triangle) => {
    for (let k = 0; k < 3; ++k) {
      const [a, b] = [corners[k], corners[(k + 1) % 3]];
      if (a === b) continue;
      const key = Math.min(a, b) * places.size + Math.max(a, b),
        side = sides.get(key) ?? { triangle, sum: 0 };
      side.sum += a < b ? 1 : -1;
      sides.set(key, side);
      parents[piece_of(triangle)] = piece_of(side.triangle);
    }
  });
  const open = new Set();
  for (const { triangle, sum } of sides.values()) if (sum !== 0) open.add(piece_of(triangle));
  let first = 0;
  return meshes.map(({ indices }) => {
    const kept = [];
    for (let i = 0; i + 2 < indices.length; i += 3, ++first)
      if (!open.has(piece_of(first))) kept.push(indices[i], indices[i + 1], indices[i + 2]);
    return Uint32Array.from(kept);
  });
}

/** Sets the uniforms of k_cut_inputs and k_cut for a part; `cut` as the server states it, or null: it is whole. */
export function bind_cut(gl, at, cut) {
  gl.uniform1i(at("u_is_cap"), 0);
  gl.uniform4fv(at("u_cut"), cut ? [...cut.normal, -cut.offset_m] : [0, 0, 0, -1]);
  gl.uniform3fv(at("u_hatch"), cut?.hatch ?? [0, 0, 0]);
  gl.uniform2fv(at("u_line"), cut?.line ?? [0, 1]);
  gl.uniform3fv(at("u_cap_colour"), cut?.colour ?? [0, 0, 0]);
}

function upload(gl, array, positions, indices) {
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, positions, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
}

/** Draws caps with the help of the framebuffer's stencil, which must be clear and is left clear. */
export class Caps {
  #gl;
  #pass;
  #closed = new WeakMap(); // of a part's list of meshes: {arrays, centre, radius}
  #quad;
  #quad_corners;

  /** `make_pass` as in mesh_gl.js. */
  constructor(gl, make_pass) {
    this.#gl = gl;
    this.#pass = make_pass(gl, k_count_vertex, k_count_fragment);
    this.#quad = gl.createVertexArray();
    this.#quad_corners = gl.createBuffer();
    gl.bindVertexArray(this.#quad);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.#quad_corners);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
  }

  /**
   * Draws the cap of a part: `meshes` are its uploaded meshes, always the same list, in one frame; `use` binds the program of the part
   * again and returns the locations of its uniforms, which bind_cut() has set.
   */
  draw(meshes, clip_from_mesh, cut, use) {
    const gl = this.#gl,
      part = this.#part_of(meshes);
    if (!part.arrays.length) return;
    gl.enable(gl.STENCIL_TEST);
    this.#count(part, clip_from_mesh, cut);
    gl.stencilFunc(gl.NOTEQUAL, 0, 0xff);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.KEEP);
    const at = use();
    gl.uniform1i(at("u_is_cap"), 1);
    gl.bindVertexArray(this.#quad);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.#quad_corners);
    gl.bufferData(gl.ARRAY_BUFFER, corners_of(part, cut), gl.DYNAMIC_DRAW);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.uniform1i(at("u_is_cap"), 0);
    gl.disable(gl.STENCIL_TEST);
    gl.clear(gl.STENCIL_BUFFER_BIT);
  }

  // Counts for each pixel how often its ray leaves the kept side's surfaces less how often it enters them: not 0 where it meets the
  // plane inside.
  #count(part, clip_from_mesh, cut) {
    const gl = this.#gl,
      { program, at } = this.#pass;
    gl.useProgram(program);
    gl.uniformMatrix4fv(at("u_clip_from_mesh"), false, clip_from_mesh);
    gl.uniform4fv(at("u_cut"), [...cut.normal, -cut.offset_m]);
    gl.colorMask(false, false, false, false);
    gl.depthMask(false);
    gl.disable(gl.DEPTH_TEST);
    gl.stencilFunc(gl.ALWAYS, 0, 0xff);
    gl.stencilOpSeparate(gl.FRONT, gl.KEEP, gl.KEEP, gl.DECR_WRAP);
    gl.stencilOpSeparate(gl.BACK, gl.KEEP, gl.KEEP, gl.INCR_WRAP);
    for (const { array, count } of part.arrays) {
      gl.bindVertexArray(array);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
    }
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    gl.colorMask(true, true, true, true);
  }

  #part_of(meshes) {
    if (!this.#closed.has(meshes)) {
      const gl = this.#gl,
        low = [Infinity, Infinity, Infinity],
        high = [-Infinity, -Infinity, -Infinity],
        arrays = [];
      closed_indices(meshes).forEach((indices, i) => {
        const { positions } = meshes[i];
        for (const index of indices)
          for (let k = 0; k < 3; ++k) {
            low[k] = Math.min(low[k], positions[3 * index + k]);
            high[k] = Math.max(high[k], positions[3 * index + k]);
          }
        if (!indices.length) return;
        arrays.push({ array: gl.createVertexArray(), count: indices.length });
        upload(gl, arrays.at(-1).array, positions, indices);
      });
      this.#closed.set(meshes, {
        arrays,
        centre: low.map((value, k) => (value + high[k]) / 2),
        radius: Math.hypot(...low.map((value, k) => high[k] - value)) / 2,
      });
    }
    return this.#closed.get(meshes);
  }

  /** Frees what was made for a part. */
  forget(meshes) {
    for (const { array } of this.#closed.get(meshes)?.arrays ?? []) this.#gl.deleteVertexArray(array);
    this.#closed.delete(meshes);
  }
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// A square on the plane that covers the part.
function corners_of({ centre, radius }, { normal, offset_m }) {
  const height = normal.reduce((sum, value, k) => sum + value * centre[k], -offset_m),
    least = normal.map(Math.abs).indexOf(Math.min(...normal.map(Math.abs))),
    u = cross(normal, [0, 1, 2].map((k) => Number(k === least))),
    along = u.map((value) => value / Math.hypot(...u)),
    beside = cross(normal, along);
  return Float32Array.from(
    [[-1, -1], [1, -1], [-1, 1], [1, 1]].flatMap(([a, b]) =>
      centre.map((value, k) => value - height * normal[k] + radius * (a * along[k] + b * beside[k])),
    ),
  );
}
