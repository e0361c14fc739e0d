// What the 3D views share: programs, and meshes on the GPU.
import { upload_maps } from "/mesh_material.js";

const k_attributes = ["a_position", "a_normal", "a_uv", "a_second_uv", "a_tangent"];

/** Compiles a program; its attributes are those of upload_mesh(). Throws an Error with the driver's message. */
export function make_program(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [type, text] of [
    [gl.VERTEX_SHADER, vertex],
    [gl.FRAGMENT_SHADER, fragment],
  ]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  k_attributes.forEach((name, i) => gl.bindAttribLocation(program, i, name));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return program;
}

// Locations of a program's uniforms by name, each asked for once.
function uniforms_of(gl, program) {
  const found = new Map();
  return (name) => {
    if (!found.has(name)) found.set(name, gl.getUniformLocation(program, name));
    return found.get(name);
  };
}

/** A program of make_program(), and `at`, the locations of its uniforms by name. */
export function make_pass(gl, vertex, fragment) {
  const program = make_program(gl, vertex, fragment);
  return { program, at: uniforms_of(gl, program) };
}

/** A mesh of read_glb() on the GPU: its members, with `array`, `count`, `texture` and `map_textures`. */
export function upload_mesh(gl, mesh) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  const attribute = (index, numbers, width) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, width, gl.FLOAT, false, 0, 0);
  };
  attribute(0, mesh.positions, 3);
  attribute(1, mesh.normals, 3);
  if (mesh.uvs) attribute(2, mesh.uvs, 2);
  if (mesh.second_uvs) attribute(3, mesh.second_uvs, 2);
  if (mesh.tangents) attribute(4, mesh.tangents, 4);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.indices, gl.STATIC_DRAW);
  const textures = textures_of(gl),
    take = (picture, is_colour) => textures.take(picture, is_colour);
  const map_textures = mesh.maps ? upload_maps(mesh, take) : [];
  return { ...mesh, array, count: mesh.indices.length, texture: take(mesh.texture, true), map_textures };
}

// The textures of a context's meshes. Those of one image share a texture, and so do all without an image.
class Textures {
  #gl;
  #by_picture = [new Map(), new Map()]; // {texture, users} by image (null: white): of numbers, of colours
  constructor(gl) {
    this.#gl = gl;
  }
  take(picture, is_colour) {
    const known = this.#by_picture[picture && is_colour ? 1 : 0],
      key = picture ?? null;
    if (!known.has(key)) known.set(key, { texture: make_texture(this.#gl, picture, is_colour), users: 0 });
    const entry = known.get(key);
    ++entry.users;
    return entry.texture;
  }
  give_back(texture) {
    for (const known of this.#by_picture)
      for (const [key, entry] of known)
        if (entry.texture === texture && --entry.users === 0) {
          this.#gl.deleteTexture(texture);
          known.delete(key);
        }
  }
}

const k_textures = new WeakMap(); // by context

function textures_of(gl) {
  if (!k_textures.has(gl)) k_textures.set(gl, new Textures(gl));
  return k_textures.get(gl);
}

// Makes a texture from an image, or from one white pixel. `is_colour`: it is sRGB.
function make_texture(gl, picture, is_colour) {
  const format = is_colour ? gl.SRGB8_ALPHA8 : gl.RGBA8;
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  if (picture) gl.texImage2D(gl.TEXTURE_2D, 0, format, gl.RGBA, gl.UNSIGNED_BYTE, picture);
  else
    gl.texImage2D(
      gl.TEXTURE_2D,
      0,
      format,
      1,
      1,
      0,
      gl.RGBA,
      gl.UNSIGNED_BYTE,
      new Uint8Array([255, 255, 255, 255]),
    );
  gl.generateMipmap(gl.TEXTURE_2D);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
  return texture;
}

/** Frees a mesh of upload_mesh(). */
export function delete_mesh(gl, { array, texture, map_textures }) {
  gl.deleteVertexArray(array);
  for (const each of [texture, ...map_textures]) textures_of(gl).give_back(each);
}
