// Draws the parts for each eye of WebXR glasses, over what the person sees. For each eye the prototype is drawn first, into
// textures: its depth, which hides parts, and where projectors light it. `rest` then leaves a part transparent wherever the ray
// behind it meets lit prototype, because light shows it there (the rule of shaders/part_coverage.glsl).
import { bind_cut, Caps, k_cut, k_cut_inputs } from "/cut.js";
import { GlassesCamera } from "/glasses_camera.js";
import { product, read_glb } from "/glb.js";
import { delete_mesh, make_pass, upload_mesh } from "/mesh_gl.js";
import { bind_material, k_material, k_material_inputs } from "/mesh_material.js";

const k_near = 0.05,
  k_far = 20, // m
  k_endless = 1e6; // m
const k_shadow_px = 2048,
  k_outline_px = 1024,
  k_most_projectors = 8;
const k_depth_kinds = ["none", "raw", "bytes", "buffer"]; // how a texture states depth: u_depth_kind is the index
const k_moved = 2e-4; // shadows are drawn again when the prototype has moved by more, in m and of a quaternion

const k_vertex = `#version 300 es
uniform mat4 u_world_from_model, u_view_from_world, u_clip_from_view;
in vec3 a_position;
out vec3 v_position, v_world;
${k_material_inputs}
${k_cut_inputs}
void main() {
  pass_cut(a_position);
  vec4 p_world = u_world_from_model * vec4(a_position, 1), p_view = u_view_from_world * p_world;
  v_world = p_world.xyz;
  v_position = p_view.xyz;
  pass_material(mat3(u_view_from_world) * mat3(u_world_from_model));
  gl_Position = u_clip_from_view * p_view;
}`;

const k_shadow_vertex = `#version 300 es
uniform mat4 u_clip_from_world, u_world_from_model;
in vec3 a_position;
void main() { gl_Position = u_clip_from_world * (u_world_from_model * vec4(a_position, 1)); }`;

const k_nothing = `#version 300 es
void main() {}`;

// Red: whether a projector lights the prototype there. Green: the cosine of its flat normal and the ray.
const k_prototype_fragment = `#version 300 es
precision highp float;
precision highp sampler2DArray;
precision highp sampler2DArrayShadow;
uniform sampler2DArrayShadow s_shadows;
uniform sampler2DArray s_outlines;
uniform mat4 u_clip_from_world[${k_most_projectors}];
uniform vec3 u_p_projector[${k_most_projectors}];
uniform int u_projector_count;
uniform vec3 u_p_eye;
in vec3 v_world;
out vec4 o_place;
void main() {
  vec3 d = normalize(v_world - u_p_eye), n = normalize(cross(dFdx(v_world), dFdy(v_world)));
  if (dot(n, d) > 0.0) n = -n;
  float lit = 0.0;
  for (int j = 0; j < u_projector_count; ++j) {
    vec3 to_projector = u_p_projector[j] - v_world;
    if (dot(n, to_projector) <= 0.0) continue;
    vec4 clip = u_clip_from_world[j] * vec4(v_world + 3e-4 * n, 1);
    vec3 at = 0.5 * clip.xyz / clip.w + 0.5;
    if (clip.w <= 0.0 || any(lessThan(at, vec3(0))) || any(greaterThan(at, vec3(1)))) continue;
    if (texture(s_outlines, vec3(at.xy, j)).r < 0.5) continue;
    if (texture(s_shadows, vec4(at.xy, j, at.z)) >= 0.5) lit = 1.0;
  }
  o_place = vec4(lit, -dot(n, d), 0, 1);
}`;

const k_part_fragment = `#version 300 es
precision highp float;
precision highp sampler2DArray;
uniform float u_cut_below;
uniform bool u_rest, u_on_surface, u_has_prototype;
uniform sampler2D s_place, s_prototype, s_depth;
uniform sampler2DArray s_depths;
uniform int u_depth_kind; // of k_depth_kinds
uniform float u_depth_layer, u_depth_scale; // layer of s_depths, or below 0 for s_depth; metres of a raw value of 1
uniform vec2 u_depth_range; // near and far plane of a depth buffer, m
uniform mat4 u_clip_from_view, u_depth_from_view;
uniform ivec2 u_corner;
uniform vec2 u_size;
in vec3 v_position;
out vec4 o_colour;
${k_material}
${k_cut}
const float k_on_surface = 0.002, k_same_place = 1e-4; // m, as in Limn's shaders
const float k_nearer = 0.03; // m; a hand is nearer than what it hides by more than the depth sensor's noise
// Distance of real things from the eye's plane, m; 0: not measured there.
float real_depth(vec2 px) {
  vec4 place = u_depth_from_view * vec4(px.x, u_depth_kind == 3 ? px.y : 1.0 - px.y, 0, 1);
  vec2 at = place.xy / place.w;
  vec4 raw = u_depth_layer < 0.0 ? texture(s_depth, at) : texture(s_depths, vec3(at, u_depth_layer));
  if (u_depth_kind == 1) return raw.r * u_depth_scale;
  if (u_depth_kind == 2) return dot(raw.ra, vec2(255, 255 * 256)) * u_depth_scale;
  return raw.r > 0.0 ? u_depth_range.x / max(1.0 - raw.r * (1.0 - u_depth_range.x / u_depth_range.y), 1e-6) : 0.0;
}
void main() {
  vec4 texel = material_texel();
  vec3 cap = cap_colour();
  if (is_cut_away() || !u_is_cap && texel.a < u_cut_below) discard;
  ivec2 px = ivec2(gl_FragCoord.xy) - u_corner;
  float depth = u_has_prototype ? texelFetch(s_prototype, px, 0).r : 1.0, z_behind = 1e6;
  bool by_light = false;
  if (depth < 1.0) {
    z_behind = u_clip_from_view[3].z / (2.0 * depth - 1.0 + u_clip_from_view[2].z);
    vec2 place = texelFetch(s_place, px, 0).rg;
    float height = (z_behind / -v_position.z - 1.0) * length(v_position) * place.g;
    if (height < (u_on_surface ? -k_on_surface : -k_same_place)) discard;
    by_light = place.r > 0.5 && (!u_on_surface || height <= k_on_surface);
  }
  if (u_depth_kind > 0) {
    float real = real_depth((gl_FragCoord.xy - vec2(u_corner)) / u_size);
    if (real > 0.0 && real < min(-v_position.z, z_behind) - k_nearer) discard;
  }
  if (u_rest && by_light) {
    o_colour = vec4(0);
    return;
  }
  vec3 linear = u_is_cap ? cap : material_light(texel, normalize(-v_position));
  o_colour = vec4(pow(clamp(linear, 0.0, 1.0), vec3(1.0 / 2.2)), 1);
}`;

// A hand as spheres along its bones; it only hides what is behind it.
const k_most_spheres = 120,
  k_between = 3, // spheres between two joints
  k_skin = 1.2; // of a joint's stated radius, so that no rim of a part is left beside a finger
const k_hand_vertex = `#version 300 es
uniform mat4 u_clip_from_feed;
uniform vec4 u_spheres[${k_most_spheres}];
in vec3 a_position;
void main() {
  vec4 sphere = u_spheres[gl_InstanceID];
  gl_Position = u_clip_from_feed * vec4(sphere.xyz + sphere.w * a_position, 1);
}`;

// A text in front of the head, since in glasses the page itself is not seen.
const k_words_vertex = `#version 300 es
uniform mat4 u_clip_from_view;
in vec2 a_uv;
out vec2 v_uv;
void main() {
  v_uv = vec2(a_uv.x, 1.0 - a_uv.y);
  gl_Position = u_clip_from_view * vec4((a_uv.x - 0.5) * 0.8, (a_uv.y - 0.5) * 0.2 - 0.1, -1.2, 1);
}`;
const k_words_fragment = `#version 300 es
precision highp float;
uniform sampler2D u_texture;
in vec2 v_uv;
out vec4 o_colour;
void main() { o_colour = texture(u_texture, v_uv); }`;
const k_words_px = [1024, 256];

/** The matrix (column-major) of a pose [w, x, y, z, tx, ty, tz]. */
function matrix_of([w, x, y, z, ...t]) {
  return new Float32Array([
    1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0,
    2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0,
    2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0,
    ...t, 1,
  ]);
}

/** The inverse of a rigid motion's matrix. */
function inverse_of(m) {
  const t = [0, 1, 2].map((k) => -(m[4 * k] * m[12] + m[4 * k + 1] * m[13] + m[4 * k + 2] * m[14]));
  return new Float32Array([m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0, ...t, 1]);
}

// A frustum through the outline of a projector's light, whose frame has x right, y down, z forward.
function frustum_of(outline, near, far) {
  const range = (k) => [Math.min(...outline.map((p) => p[k])), Math.max(...outline.map((p) => p[k]))];
  const [left, right] = range(0),
    [top, bottom] = range(1);
  const clip_from_projector = new Float32Array([
    2 / (right - left), 0, 0, 0,
    0, 2 / (bottom - top), 0, 0,
    -(left + right) / (right - left), -(top + bottom) / (bottom - top), (far + near) / (far - near), 1,
    0, 0, (-2 * far * near) / (far - near), 0,
  ]);
  return { clip_from_projector, left, right, top, bottom };
}

const linear = (level) => (level <= 0.04045 ? level / 12.92 : ((level + 0.055) / 1.055) ** 2.4);

// The colour of a part that people have chosen instead of the file's; null: none.
function override_of(material) {
  const found = /^#([0-9a-f]{6})/.exec(material ?? "");
  return found && [0, 2, 4].map((at) => linear(parseInt(found[1].slice(at, at + 2), 16) / 255));
}

async function fetched(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw new Error((await answer.json().catch(() => ({}))).error ?? `${path}: ${answer.status}`);
  return answer;
}

/** Meshes by path, fetched when they are first asked for. */
class MeshStore {
  #gl;
  #all = new Map();
  #fetching = new Set(); // entries on their way
  problem = ""; // why one could not be fetched
  #caps; // what is made for a part's cap is freed with its meshes
  constructor(gl, caps) {
    this.#gl = gl;
    this.#caps = caps;
  }
  get is_fetching() {
    return this.#fetching.size > 0;
  }
  /** The meshes on the GPU; an empty list while they are on their way. */
  of(path) {
    if (!this.#all.has(path)) {
      const entry = { meshes: [] };
      this.#all.set(path, entry);
      this.#fetching.add(entry);
      fetched(path)
        .then((answer) => answer.arrayBuffer())
        .then(read_glb)
        .then((meshes) => {
          if (this.#all.get(path) === entry) entry.meshes = meshes.map((mesh) => upload_mesh(this.#gl, mesh));
        })
        .catch((problem) => (this.problem = `A part could not be fetched: ${problem.message}`))
        .finally(() => this.#fetching.delete(entry));
    }
    return this.#all.get(path).meshes;
  }
  clear() {
    for (const { meshes } of this.#all.values()) {
      this.#caps.forget(meshes);
      for (const mesh of meshes) delete_mesh(this.#gl, mesh);
    }
    this.#all.clear();
    this.#fetching.clear();
    this.problem = "";
  }
}

// A sphere of radius 1.
function sphere_mesh(columns = 10, rows = 6) {
  const positions = [],
    indices = [];
  for (let row = 0; row <= rows; ++row)
    for (let column = 0; column <= columns; ++column) {
      const [polar, round] = [(Math.PI * row) / rows, (2 * Math.PI * column) / columns];
      positions.push(Math.sin(polar) * Math.cos(round), Math.cos(polar), Math.sin(polar) * Math.sin(round));
      if (row === rows || column === columns) continue;
      const at = row * (columns + 1) + column;
      indices.push(at, at + 1, at + columns + 1, at + 1, at + columns + 2, at + columns + 1);
    }
  const points = Float32Array.from(positions);
  return { positions: points, normals: points, uvs: null, texture: null, indices: Uint32Array.from(indices) };
}

/** Hands as the device tracks them, drawn into the depth alone, so that parts are hidden behind them. */
class Hands {
  #gl;
  #pass;
  #sphere;
  constructor(gl) {
    this.#gl = gl;
    this.#pass = make_pass(gl, k_hand_vertex, k_nothing);
    this.#sphere = upload_mesh(gl, sphere_mesh());
  }
  /** Lists of spheres [x, y, z, radius, …] in the space, one for each hand that is tracked. */
  static spheres_of(frame, space, sources) {
    const hands = [];
    for (const { hand } of sources ?? []) {
      const spheres = [];
      let wrist = null,
        before = null;
      for (const joint of hand?.values() ?? []) {
        const pose = frame.getJointPose?.(joint, space);
        if (!pose) continue;
        const { x, y, z } = pose.transform.position,
          at = [x, y, z, k_skin * (pose.radius || 0.008)];
        wrist ??= at;
        const from = joint.jointName?.endsWith("metacarpal") ? wrist : (before ?? at);
        for (let i = 1; i <= k_between + 1; ++i)
          spheres.push(...at.map((value, k) => from[k] + ((value - from[k]) * i) / (k_between + 1)));
        before = at;
      }
      if (spheres.length) hands.push(spheres.slice(0, 4 * k_most_spheres));
    }
    return hands;
  }
  draw(hands, clip_from_feed) {
    const gl = this.#gl;
    if (!hands.length) return;
    gl.useProgram(this.#pass.program);
    gl.enable(gl.DEPTH_TEST);
    gl.colorMask(false, false, false, false);
    gl.uniformMatrix4fv(this.#pass.at("u_clip_from_feed"), false, clip_from_feed);
    gl.bindVertexArray(this.#sphere.array);
    for (const spheres of hands) {
      gl.uniform4fv(this.#pass.at("u_spheres"), spheres);
      gl.drawElementsInstanced(gl.TRIANGLES, this.#sphere.count, gl.UNSIGNED_INT, 0, spheres.length / 4);
    }
    gl.colorMask(true, true, true, true);
  }
}

/** The light of the projectors: where each is, and its shadows on the prototype. */
class ProjectorLight {
  #gl;
  #pass;
  #frame;
  #shadows;
  #outlines;
  #drawn_for = null; // the prototype's pose and meshes that the shadows belong to
  #projectors = [];
  clips = [];

  constructor(gl) {
    this.#gl = gl;
    this.#pass = make_pass(gl, k_shadow_vertex, k_nothing);
    this.#frame = gl.createFramebuffer();
    this.#shadows = gl.createTexture();
    this.#outlines = gl.createTexture();
  }

  get count() {
    return this.#projectors.length;
  }

  set({ projectors }) {
    const gl = this.#gl;
    this.#projectors = projectors.filter(({ outline }) => outline.length > 2).slice(0, k_most_projectors);
    this.#drawn_for = null;
    const layers = Math.max(1, this.count);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.#shadows);
    gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.DEPTH_COMPONENT24, k_shadow_px, k_shadow_px, layers, 0, gl.DEPTH_COMPONENT,
      gl.UNSIGNED_INT, null);
    for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"])
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl[name], gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL);
    for (const name of ["TEXTURE_WRAP_S", "TEXTURE_WRAP_T"])
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl[name], gl.CLAMP_TO_EDGE);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.#outlines);
    gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.RGBA8, k_outline_px, k_outline_px, layers, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    this.#projectors.forEach((projector, j) => this.#draw_outline(projector.outline, j));
    for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"])
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl[name], gl.LINEAR);
    for (const name of ["TEXTURE_WRAP_S", "TEXTURE_WRAP_T"])
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl[name], gl.CLAMP_TO_EDGE);
  }

  // The outline of a projector's light as an image over its frustum.
  #draw_outline(outline, layer) {
    const gl = this.#gl,
      { left, right, top, bottom } = frustum_of(outline, 1, 2);
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = k_outline_px;
    const context = canvas.getContext("2d");
    context.fillStyle = "#fff";
    context.beginPath();
    for (const [x, y] of outline)
      context.lineTo(((x - left) / (right - left)) * k_outline_px, ((y - top) / (bottom - top)) * k_outline_px);
    context.fill();
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, layer, k_outline_px, k_outline_px, 1, gl.RGBA, gl.UNSIGNED_BYTE, canvas);
  }

  /** Draws the shadows again if the prototype has moved. */
  update(meshes, pose) {
    const before = this.#drawn_for;
    const is_same =
      before && before.meshes === meshes && before.pose.every((value, k) => Math.abs(value - pose[k]) < k_moved);
    if (is_same) return;
    this.#drawn_for = { meshes, pose };
    const gl = this.#gl,
      world_from_prototype = matrix_of(pose);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#frame);
    gl.viewport(0, 0, k_shadow_px, k_shadow_px);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1.5, 2);
    gl.useProgram(this.#pass.program);
    this.clips = this.#projectors.map((projector, j) => {
      const world_from_projector = matrix_of(projector.world_from_projector);
      const { clip_from_projector } = frustum_of(projector.outline, 0.1, 10);
      const clip_from_world = product(clip_from_projector, inverse_of(world_from_projector));
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, this.#shadows, 0, j);
      gl.clear(gl.DEPTH_BUFFER_BIT);
      gl.uniformMatrix4fv(this.#pass.at("u_clip_from_world"), false, clip_from_world);
      for (const mesh of meshes) {
        gl.uniformMatrix4fv(this.#pass.at("u_world_from_model"), false, product(world_from_prototype, mesh.matrix));
        gl.bindVertexArray(mesh.array);
        gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
      }
      return { clip_from_world, p_world: projector.world_from_projector.slice(4) };
    });
    gl.disable(gl.POLYGON_OFFSET_FILL);
  }

  bind(at) {
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.#shadows);
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.#outlines);
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform1i(at("s_shadows"), 1);
    gl.uniform1i(at("s_outlines"), 2);
    gl.uniform1i(at("u_projector_count"), this.clips.length);
    if (!this.clips.length) return;
    gl.uniformMatrix4fv(at("u_clip_from_world"), false, this.clips.flatMap((one) => [...one.clip_from_world]));
    gl.uniform3fv(at("u_p_projector"), this.clips.flatMap((one) => one.p_world));
  }
}

// How the browser gives the depth of real things: "cpu-optimized", "gpu-optimized", or "none".
function depth_usage_of(xr) {
  try {
    const is_granted = xr.enabledFeatures?.includes("depth-sensing") ?? true;
    return (is_granted && xr.depthUsage) || "none";
  } catch {
    return "none"; // browsers refuse to say when it was not granted
  }
}

/** The depth of real things in each eye's image. */
class RealDepth {
  #xr;
  #gl;
  #usage;
  #texture;
  #binding = null;
  constructor(xr, gl) {
    this.#xr = xr;
    this.#gl = gl;
    this.#usage = depth_usage_of(xr);
    this.#texture = gl.createTexture();
    if (this.#usage === "gpu-optimized" && window.XRWebGLBinding?.prototype.getDepthInformation)
      this.#binding = new XRWebGLBinding(xr, gl);
  }
  /** Whether the browser gives it. */
  get is_known() {
    return this.#usage === "cpu-optimized" || this.#binding !== null;
  }
  /** {kind, texture, layer, scale, near, far, matrix} as in the shader; null: not known in this frame. */
  of(frame, view) {
    try {
      if (this.#binding) return this.#by_texture(this.#binding.getDepthInformation(view));
      if (this.#usage === "cpu-optimized") return this.#by_data(frame.getDepthInformation?.(view));
    } catch {
      // it was not granted, or has been withdrawn
    }
    return null;
  }
  #by_data(depth) {
    if (!depth?.width) return null;
    const raw = this.#xr.depthDataFormat === "float32" ? new Float32Array(depth.data) : new Uint16Array(depth.data);
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE5);
    gl.bindTexture(gl.TEXTURE_2D, this.#texture);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, depth.width, depth.height, 0, gl.RED, gl.FLOAT, Float32Array.from(raw));
    for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.NEAREST);
    gl.activeTexture(gl.TEXTURE0);
    return this.#with(depth, "raw", this.#texture, -1);
  }
  // Headsets give a depth buffer with its near plane, rows from below, whatever format they say; phones a texture of the format that
  // they say, rows from above. A texture of integers cannot be read by these shaders.
  #by_texture(depth) {
    if (!depth?.texture) return null;
    const layer = depth.textureType === "texture-array" ? (depth.imageIndex ?? 0) : -1;
    if (layer >= 0 && depth.depthNear > 0) return this.#with(depth, "buffer", depth.texture, layer);
    const kind = { "luminance-alpha": "bytes", float32: "raw" }[this.#xr.depthDataFormat];
    return kind ? this.#with(depth, kind, depth.texture, layer) : null;
  }
  #with(depth, kind, texture, layer) {
    return {
      kind: k_depth_kinds.indexOf(kind),
      texture,
      layer,
      scale: depth.rawValueToMeters,
      near: depth.depthNear ?? 0,
      far: Math.min(depth.depthFar ?? k_endless, k_endless),
      matrix: depth.normDepthBufferFromNormView.matrix,
    };
  }
}

/** Draws for one WebXR session. */
export class GlassesView {
  #xr;
  #gl;
  #layer;
  #real_depth;
  #camera = null; // null: the browser gives no pictures of it
  #light;
  #hands;
  #meshes;
  #caps;
  #prototype_pass;
  #part_pass;
  #words_pass;
  #place_frame;
  #place = { texture: null, depth: null, width: 0, height: 0 };
  #words_texture;
  #words_quad;
  #words = "";
  #scene = -1;
  #lit_scene = -1; // the scene whose projectors have been fetched

  /** Makes a session's layer. Throws an Error whose message can be shown. */
  static async open(xr) {
    const canvas = document.createElement("canvas");
    const gl = canvas.getContext("webgl2", { xrCompatible: true, alpha: true });
    if (!gl) throw new Error("this browser has no WebGL 2.");
    await gl.makeXRCompatible?.();
    return new GlassesView(xr, gl);
  }

  constructor(xr, gl) {
    this.#xr = xr;
    this.#gl = gl;
    this.#layer = new XRWebGLLayer(xr, gl, { alpha: true, depth: true, stencil: true, antialias: true });
    xr.updateRenderState({ baseLayer: this.#layer, depthNear: k_near, depthFar: k_far });
    this.#light = new ProjectorLight(gl);
    this.#hands = new Hands(gl);
    this.#caps = new Caps(gl, make_pass);
    this.#meshes = new MeshStore(gl, this.#caps);
    this.#prototype_pass = make_pass(gl, k_vertex, k_prototype_fragment);
    this.#part_pass = make_pass(gl, k_vertex, k_part_fragment);
    this.#words_pass = make_pass(gl, k_words_vertex, k_words_fragment);
    this.#place_frame = gl.createFramebuffer();
    this.#real_depth = new RealDepth(xr, gl);
    if (GlassesCamera.is_granted(xr)) this.#camera = new GlassesCamera(xr, gl);
    this.#words_texture = gl.createTexture();
    this.#words_quad = gl.createVertexArray();
    gl.bindVertexArray(this.#words_quad);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(2);
    gl.vertexAttribPointer(2, 2, gl.FLOAT, false, 0, 0);
    this.#light.set({ projectors: [] });
  }

  close() {
    this.#camera?.close();
    this.#meshes.clear();
    this.#gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  /** The glasses' camera; null: the browser gives no pictures of it. */
  get camera() {
    return this.#camera?.is_missing ? null : this.#camera;
  }

  /** What hides parts: "things" all of them, tracked "hands" alone, or "nothing" but the prototype. */
  get hidden_by() {
    if (this.#real_depth.is_known) return "things";
    return this.#xr.enabledFeatures?.includes("hand-tracking") ? "hands" : "nothing";
  }

  /** Whether something that belongs to the picture is still on its way. */
  get is_fetching() {
    return this.#meshes.is_fetching || this.#lit_scene !== this.#scene;
  }

  /**
   * Draws a frame: `space` is the feed, `world_from_feed` a short pose, or null while nothing may be drawn; `parts` the message glasses_parts;
   * `mode` rest or full; `slots` the state's; `words` a text for the person, empty: none.
   */
  draw(frame, pose, { space, world_from_feed, parts, mode, slots, words }) {
    const gl = this.#gl;
    if (parts && parts.scene !== this.#scene) this.#begin_scene(parts.scene);
    const prototype = parts?.prototype ? this.#meshes.of("/glasses/prototype.glb") : [];
    if (world_from_feed && prototype.length) this.#light.update(prototype, parts.prototype);
    const feed_from_world = world_from_feed && inverse_of(matrix_of(world_from_feed));
    const hands = feed_from_world ? Hands.spheres_of(frame, space, this.#xr.inputSources) : [];
    const framebuffer = this.#layer.framebuffer;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.clearColor(0, 0, 0, 0);
    gl.disable(gl.BLEND);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    for (const view of pose?.views ?? []) {
      const corner = this.#layer.getViewport(view);
      if (!corner?.width) continue;
      const eye = {
        viewport: corner,
        clip_from_view: view.projectionMatrix,
        depth: this.#real_depth.of(frame, view),
        view_from_world: feed_from_world && product(view.transform.inverse.matrix, feed_from_world),
      };
      if (feed_from_world && parts) {
        this.#draw_prototype(eye, prototype, parts.prototype);
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        gl.viewport(corner.x, corner.y, corner.width, corner.height);
        this.#hands.draw(hands, product(eye.clip_from_view, view.transform.inverse.matrix));
        this.#draw_parts(eye, parts.parts, mode, slots, prototype.length > 0);
      }
      const text = words || this.#meshes.problem;
      if (text) this.#draw_words(eye, text, framebuffer);
    }
  }

  // A new scene or rig: its meshes and its light are fetched again.
  #begin_scene(scene) {
    this.#scene = scene;
    this.#meshes.clear();
    fetched("/glasses/light.json")
      .then((answer) => answer.json())
      .then((light) => this.#scene === scene && this.#light.set(light))
      .catch((problem) => (this.#meshes.problem = `The projectors could not be fetched: ${problem.message}`))
      .finally(() => this.#scene === scene && (this.#lit_scene = scene));
  }

  #size_place(width, height) {
    const gl = this.#gl,
      place = this.#place;
    if (place.width === width && place.height === height) return;
    for (const old of [place.texture, place.depth]) gl.deleteTexture(old);
    const made = (internal, format, type) => {
      const texture = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, format, type, null);
      for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"])
        gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.NEAREST);
      return texture;
    };
    this.#place = {
      texture: made(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE),
      depth: made(gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT),
      width,
      height,
    };
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#place_frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.#place.texture, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.#place.depth, 0);
  }

  #use(pass, { clip_from_view, view_from_world }) {
    const gl = this.#gl;
    gl.useProgram(pass.program);
    gl.enable(gl.DEPTH_TEST);
    gl.uniformMatrix4fv(pass.at("u_clip_from_view"), false, clip_from_view);
    gl.uniformMatrix4fv(pass.at("u_view_from_world"), false, view_from_world);
    return pass.at;
  }

  // The prototype's depth and light, into textures of the eye's size.
  #draw_prototype(eye, meshes, pose) {
    const gl = this.#gl,
      { width, height } = eye.viewport;
    this.#size_place(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#place_frame);
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!meshes.length) return;
    const at = this.#use(this.#prototype_pass, eye);
    this.#light.bind(at);
    gl.uniform3fv(at("u_p_eye"), inverse_of(eye.view_from_world).slice(12, 15));
    const world_from_prototype = matrix_of(pose);
    for (const mesh of meshes) {
      gl.uniformMatrix4fv(at("u_world_from_model"), false, product(world_from_prototype, mesh.matrix));
      gl.bindVertexArray(mesh.array);
      gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
    }
  }

  #bind_depth(at, depth) {
    const gl = this.#gl;
    gl.uniform1i(at("u_depth_kind"), depth?.kind ?? 0);
    gl.uniform1i(at("s_depth"), 5);
    gl.uniform1i(at("s_depths"), 6);
    if (!depth) return;
    const is_array = depth.layer >= 0;
    gl.activeTexture(is_array ? gl.TEXTURE6 : gl.TEXTURE5);
    gl.bindTexture(is_array ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D, depth.texture);
    gl.uniform1f(at("u_depth_layer"), depth.layer);
    gl.uniform1f(at("u_depth_scale"), depth.scale);
    gl.uniform2f(at("u_depth_range"), depth.near, depth.far);
    gl.uniformMatrix4fv(at("u_depth_from_view"), false, depth.matrix);
  }

  #draw_parts(eye, parts, mode, slots, has_prototype) {
    const gl = this.#gl,
      { x, y, width, height } = eye.viewport,
      at = this.#use(this.#part_pass, eye);
    gl.uniform1i(at("u_rest"), mode === "rest");
    gl.uniform1i(at("u_has_prototype"), has_prototype);
    this.#bind_depth(at, eye.depth);
    gl.uniform2i(at("u_corner"), x, y);
    gl.uniform2f(at("u_size"), width, height);
    const bound = { s_place: [3, this.#place.texture], s_prototype: [4, this.#place.depth] };
    for (const [name, [unit, texture]] of Object.entries(bound)) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(at(name), unit);
    }
    for (const [slot, variant, pose, where, cut = null] of parts) {
      const world_from_part = matrix_of(pose);
      const chosen = override_of(slots.find(({ name }) => name === slot)?.material);
      const meshes = this.#meshes.of(`/glasses/part/${encodeURIComponent(slot)}/${encodeURIComponent(variant)}.glb`);
      gl.uniform1i(at("u_on_surface"), where === "surface");
      bind_cut(gl, at, cut);
      for (const mesh of meshes) {
        gl.uniformMatrix4fv(at("u_world_from_model"), false, product(world_from_part, mesh.matrix));
        bind_material(gl, at, mesh, chosen ? [...chosen, 1] : mesh.base);
        gl.uniform1f(at("u_cut_below"), mesh.cut_below);
        gl.bindVertexArray(mesh.array);
        gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
      }
      if (!cut || !meshes.length) continue;
      const world_from_mesh = product(world_from_part, meshes[0].matrix);
      const clip_from_mesh = product(eye.clip_from_view, product(eye.view_from_world, world_from_mesh));
      this.#caps.draw(meshes, clip_from_mesh, cut, () => this.#use(this.#part_pass, eye));
    }
  }

  #write_words(text) {
    if (text === this.#words) return;
    this.#words = text;
    const [width, height] = k_words_px,
      canvas = document.createElement("canvas"),
      context = canvas.getContext("2d");
    Object.assign(canvas, { width, height });
    context.fillStyle = "rgba(11, 11, 13, 0.85)";
    context.fillRect(0, 0, width, height);
    context.fillStyle = "#edeae4";
    context.font = "44px system-ui, sans-serif";
    const lines = [""];
    for (const word of text.split(" ")) {
      const longer = `${lines.at(-1)} ${word}`.trim();
      if (context.measureText(longer).width > width - 60) lines.push(word);
      else lines[lines.length - 1] = longer;
    }
    lines.slice(0, 4).forEach((line, i) => context.fillText(line, 30, 65 + 54 * i));
    const gl = this.#gl;
    gl.bindTexture(gl.TEXTURE_2D, this.#words_texture);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, canvas);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.LINEAR);
  }

  #draw_words(eye, text, framebuffer) {
    const gl = this.#gl,
      { x, y, width, height } = eye.viewport;
    this.#write_words(text);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.viewport(x, y, width, height);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.#words_pass.program);
    gl.uniformMatrix4fv(this.#words_pass.at("u_clip_from_view"), false, eye.clip_from_view);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.#words_texture);
    gl.uniform1i(this.#words_pass.at("u_texture"), 0);
    gl.bindVertexArray(this.#words_quad);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }
}
