// What the 3D views share: programs, meshes on the GPU, and how a surface is shaded.

/** A GLSL function for `base` (linear) of a surface with normal n, seen along -eye, both in the view's frame. */
export const k_shading = `
vec3 shaded(vec3 base, vec3 n, vec3 eye) {
  if (dot(n, eye) < 0.0) n = -n;
  float key = max(dot(n, normalize(vec3(0.5, 0.8, 0.6))), 0.0), fill = 0.5 + 0.5 * n.y;
  float rim = pow(1.0 - max(dot(n, eye), 0.0), 3.0);
  return base * (0.16 + 0.22 * fill + 0.75 * key) + vec3(0.06) * rim;
}`;

const k_attributes = ["a_position", "a_normal", "a_uv"];

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

/** A mesh of read_glb() on the GPU: its members, with `array`, `count` and `texture`. */
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
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.indices, gl.STATIC_DRAW);
  return { ...mesh, array, count: mesh.indices.length, texture: texture_of(gl, mesh.texture) };
}

// Makes a texture from an image, or from one white pixel.
function texture_of(gl, picture) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  if (picture) gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE, picture);
  else
    gl.texImage2D(
      gl.TEXTURE_2D,
      0,
      gl.SRGB8_ALPHA8,
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
export function delete_mesh(gl, { array, texture }) {
  gl.deleteVertexArray(array);
  gl.deleteTexture(texture);
}
