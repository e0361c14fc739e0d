"""Draws small surfaces with the page's own code, and compares their light with what glTF's materials mean.

    material_test.py PAGE_FOLDER
"""

import sys

from browser import answer_on_page

# A square of two pieces (left and right) that share their materials' images. Its first texture coordinates run from left to
# right, and its second ones from right to left.
DRAW = """
const { read_glb } = await import("/glb.js");
const { delete_mesh, make_program, upload_mesh } = await import("/mesh_gl.js");
const { bind_material, k_material, k_material_inputs } = await import("/mesh_material.js");
const gl = Object.assign(document.createElement("canvas"), { width: 64, height: 64 })
  .getContext("webgl2", { preserveDrawingBuffer: true, antialias: false });
const made = [], make = gl.createTexture.bind(gl);
gl.createTexture = () => (made.push(make()), made.at(-1));
const program = make_program(gl, `#version 300 es
in vec3 a_position;
${k_material_inputs}
void main() { pass_material(mat3(1)); gl_Position = vec4(a_position, 1); }`, `#version 300 es
precision highp float;
uniform vec3 u_eye;
out vec4 o_colour;
${k_material}
void main() { o_colour = vec4(material_light(material_texel(), u_eye), 1); }`);
gl.useProgram(program);
const at = (name) => gl.getUniformLocation(program, name);

// An image (PNG) of one colour, [r, g, b], on its left half, and another one on its right half.
const image = async (left, right = left) => {
  const canvas = new OffscreenCanvas(64, 4), context = canvas.getContext("2d");
  [left, right].forEach((colour, i) => {
    context.fillStyle = `rgb(${colour})`;
    context.fillRect(32 * i, 0, 32, 4);
  });
  return new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer());
};

const glb_with = (images, material) => {
  const views = [], accessors = [], chunks = [];
  let length = 0;
  const view = (bytes) => {
    views.push({ buffer: 0, byteOffset: length, byteLength: bytes.length });
    const padded = new Uint8Array((bytes.length + 3) & ~3);
    padded.set(bytes);
    chunks.push(padded);
    length += padded.length;
    return views.length - 1;
  };
  const accessor = (numbers, type, width) => {
    const bytes = new Uint8Array(Float32Array.from(numbers).buffer);
    accessors.push({ bufferView: view(bytes), componentType: 5126, count: numbers.length / width, type });
    return accessors.length - 1;
  };
  const primitives = [0, 1].map((i) => {
    const corners = [[i - 1, -1], [i, -1], [i, 1], [i - 1, -1], [i, 1], [i - 1, 1]];
    const of = (row) => corners.flatMap(([x, y]) => row((x + 1) / 2, (y + 1) / 2));
    return { material: 0, attributes: {
      POSITION: accessor(of((u, v) => [2 * u - 1, 2 * v - 1, 0]), "VEC3", 3),
      NORMAL: accessor(of(() => [0, 0, 1]), "VEC3", 3),
      TANGENT: accessor(of(() => [1, 0, 0, 1]), "VEC4", 4),
      TEXCOORD_0: accessor(of((u, v) => [u, v]), "VEC2", 2),
      TEXCOORD_1: accessor(of((u, v) => [1 - u, v]), "VEC2", 2),
    } };
  });
  const json = { asset: { version: "2.0" }, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0 }], meshes: [{ primitives }],
    materials: [material], textures: images.map((_, source) => ({ source })),
    images: images.map((bytes) => ({ bufferView: view(bytes), mimeType: "image/png" })), accessors, bufferViews: views };
  json.buffers = [{ byteLength: length }];
  let text = JSON.stringify(json);
  text += " ".repeat(-text.length & 3);
  const out = new Uint8Array(28 + text.length + length), head = new DataView(out.buffer);
  [0x46546c67, 2, out.length, text.length, 0x4e4f534a].forEach((word, i) => head.setUint32(4 * i, word, true));
  out.set(new TextEncoder().encode(text), 20);
  [length, 0x004e4942].forEach((word, i) => head.setUint32(20 + text.length + 4 * i, word, true));
  chunks.reduce((place, bytes) => (out.set(bytes, place), place + bytes.length), 28 + text.length);
  return out.buffer;
};

// Levels of red at the left and at the right of the drawn meshes, seen from direction `eye`.
const light_of = (meshes, eye) => {
  gl.viewport(0, 0, 64, 64);
  gl.clear(gl.COLOR_BUFFER_BIT);
  gl.uniform3fv(at("u_eye"), eye);
  for (const mesh of meshes) {
    bind_material(gl, at, mesh);
    gl.bindVertexArray(mesh.array);
    gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
  }
  return [12, 52].map((x) => {
    const pixel = new Uint8Array(4);
    gl.readPixels(x, 32, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    return pixel[0];
  });
};
const uploaded = async (images, material) => (await read_glb(glb_with(images, material))).map((mesh) => upload_mesh(gl, mesh));
const drawn = async (images, material, eye = [0, 0, 1]) => {
  const meshes = await uploaded(images, material), light = light_of(meshes, eye);
  for (const mesh of meshes) delete_mesh(gl, mesh);
  return light;
};

const matte = { baseColorFactor: [1, 1, 1, 1], metallicFactor: 0, roughnessFactor: 1 };
const half = await image([0, 255, 255], [255, 0, 0]); // red, that of occlusion, is 0 on the left
const occluded = (use) => drawn([half], { pbrMetallicRoughness: matte, occlusionTexture: { index: 0, ...use } });
const found = {
  plain: await drawn([], { pbrMetallicRoughness: matte }),
  occluded: await occluded({}),
  occluded_second: await occluded({ texCoord: 1 }),
  half_occluded: await occluded({ strength: 0.5 }),
};
"""

FACTS = DRAW + """
// A relief all over, turned about the x axis by so many degrees away from the viewer.
const away = (degrees) => {
  const level = (value) => Math.round(127.5 + 127.5 * value), angle = (degrees * Math.PI) / 180;
  return image([level(0), level(-Math.sin(angle)), level(Math.cos(angle))]);
};
const low = [0, Math.sin(1.48), Math.cos(1.48)]; // 85 degrees from the normal
for (const degrees of [30, 50]) {
  const relief = [await away(degrees)], coat = { clearcoatFactor: 1, clearcoatRoughnessFactor: 1 };
  found[`coat_away_${degrees}`] = await drawn(relief, { pbrMetallicRoughness: matte,
    extensions: { KHR_materials_clearcoat: { ...coat, clearcoatNormalTexture: { index: 0 } } } }, low);
  found[`away_${degrees}`] = await drawn(relief, { pbrMetallicRoughness: matte, normalTexture: { index: 0 } }, low);
}

// Two pieces with a coloured image and an occlusion map: the first is deleted while the second still uses them.
made.length = 0;
const colours = await image([255, 0, 0]);
const pair = await uploaded([half, colours],
  { pbrMetallicRoughness: { ...matte, baseColorTexture: { index: 1 } }, occlusionTexture: { index: 0 } });
found.textures = made.length;
found.pair = light_of(pair, [0, 0, 1]);
delete_mesh(gl, pair[0]);
found.one_left = light_of([pair[1]], [0, 0, 1])[1];
delete_mesh(gl, pair[1]);
found.textures_left = made.filter((texture) => gl.isTexture(texture)).length;
found.gl_error = gl.getError();
return found;
"""

# Light of a white matte surface that faces the viewer: soft light and the lamp, as in mesh_material.js.
SOFT, LAMP = 0.16 + 0.22 / 2, 0.75 * 0.537


def problems_of(found):
    """What is not as it must be, in words."""
    dark, middle, full = (255 * (share * SOFT + LAMP) for share in (0, 0.5, 1))
    wanted = {"plain": [full, full], "occluded": [dark, full], "pair": [dark, full],
              "occluded_second": [full, dark], "half_occluded": [middle, full]}
    # A relief that looks away is seen at its edge, by whatever angle it looks away.
    wanted |= {f"{kind}_50": found[f"{kind}_30"] for kind in ("coat_away", "away")}
    out = [f"{name}: expected the levels {levels}, found {found[name]}" for name, levels in wanted.items()
           if max(abs(a - b) for a, b in zip(levels, found[name])) > 2]
    facts = {"textures": 3, "textures_left": 0}  # the colour, the occlusion and a white one
    out += [f"{name}: expected {number}, found {found[name]}" for name, number in facts.items() if found[name] != number]
    if abs(found["one_left"] - full) > 2:
        out.append(f"expected the level {full} of a piece whose neighbour is deleted, found {found['one_left']}")
    if found["gl_error"]:
        out.append(f"expected no error of WebGL, found {found['gl_error']}")
    return out


def main():
    problems = problems_of(answer_on_page(sys.argv[1], "glb.js", FACTS))
    print("\n".join(problems) or "passed")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
