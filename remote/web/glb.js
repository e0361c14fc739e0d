// Reads binary glTF 2.0, as far as Limn writes it: triangles with positions, normals, tangents, two sets of uvs and
// materials, in nodes with transforms.

const k_magic = 0x46546c67,
  k_json = 0x4e4f534a,
  k_bin = 0x004e4942;
const k_types = { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
const k_counts = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

/** The product a b of two 4x4 matrices, both column-major as in glTF and WebGL. */
export function product(a, b) {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; ++column)
    for (let row = 0; row < 4; ++row)
      for (let k = 0; k < 4; ++k) out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return out;
}

function matrix_of(node) {
  if (node.matrix) return new Float32Array(node.matrix);
  const [x, y, z, w] = node.rotation ?? [0, 0, 0, 1],
    [a, b, c] = node.scale ?? [1, 1, 1],
    t = node.translation ?? [0, 0, 0];
  return new Float32Array([
    a * (1 - 2 * (y * y + z * z)),
    a * 2 * (x * y + z * w),
    a * 2 * (x * z - y * w),
    0,
    b * 2 * (x * y - z * w),
    b * (1 - 2 * (x * x + z * z)),
    b * 2 * (y * z + x * w),
    0,
    c * 2 * (x * z + y * w),
    c * 2 * (y * z - x * w),
    c * (1 - 2 * (x * x + y * y)),
    0,
    ...t,
    1,
  ]);
}

function chunks_of(buffer) {
  const head = new DataView(buffer);
  if (buffer.byteLength < 20 || head.getUint32(0, true) !== k_magic)
    throw new Error("expected a binary glTF, found another file");
  const chunks = {};
  for (let at = 12; at + 8 <= buffer.byteLength;) {
    const length = head.getUint32(at, true);
    chunks[head.getUint32(at + 4, true)] = new Uint8Array(buffer, at + 8, length);
    at += 8 + length;
  }
  return [JSON.parse(new TextDecoder().decode(chunks[k_json])), chunks[k_bin]];
}

// Returns an accessor's numbers, copied so that rows that are interleaved or unaligned become contiguous.
function numbers_of(gltf, bin, index) {
  const accessor = gltf.accessors[index],
    view = gltf.bufferViews[accessor.bufferView];
  const Type = k_types[accessor.componentType],
    width = k_counts[accessor.type];
  const at = bin.byteOffset + (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
  const row = width * Type.BYTES_PER_ELEMENT,
    stride = view.byteStride ?? row;
  const packed = new Uint8Array(accessor.count * row),
    bytes = new Uint8Array(bin.buffer);
  for (let i = 0; i < accessor.count; ++i)
    packed.set(bytes.subarray(at + i * stride, at + i * stride + row), i * row);
  return new Type(packed.buffer);
}

// Computes normals for a mesh without them: the sum of the adjacent triangles' normals at each vertex.
function normals_of(positions, indices) {
  const normals = new Float32Array(positions.length);
  for (let i = 0; i + 2 < indices.length; i += 3) {
    const [a, b, c] = [3 * indices[i], 3 * indices[i + 1], 3 * indices[i + 2]];
    const u = [0, 1, 2].map((k) => positions[b + k] - positions[a + k]),
      v = [0, 1, 2].map((k) => positions[c + k] - positions[a + k]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (const corner of [a, b, c]) for (let k = 0; k < 3; ++k) normals[corner + k] += n[k];
  }
  return normals;
}

// Returns the image of a material's texture; each is decoded only once.
function texture_of(gltf, bin, use, decoded) {
  if (use?.index === undefined) return null;
  const { source } = gltf.textures[use.index],
    image = gltf.images[source];
  const view = gltf.bufferViews[image.bufferView],
    at = view.byteOffset ?? 0;
  if (!decoded.has(source))
    decoded.set(
      source,
      createImageBitmap(new Blob([bin.subarray(at, at + view.byteLength)], { type: image.mimeType })),
    );
  return decoded.get(source);
}

// Returns the factors and maps of a material besides its colour, as members of a mesh.
async function material_of(gltf, bin, material, decoded) {
  const surface = material?.pbrMetallicRoughness,
    extensions = material?.extensions ?? {},
    layer = extensions.KHR_materials_clearcoat ?? {},
    strength = extensions.KHR_materials_emissive_strength?.emissiveStrength ?? 1;
  const uses = {
    metallic_roughness: surface?.metallicRoughnessTexture,
    normals: material?.normalTexture,
    occlusion: material?.occlusionTexture,
    emission: material?.emissiveTexture,
    coat: layer.clearcoatTexture,
    coat_roughness: layer.clearcoatRoughnessTexture,
    coat_normals: layer.clearcoatNormalTexture,
  };
  const maps = {};
  for (const [name, use] of Object.entries(uses))
    if (use)
      maps[name] = {
        picture: await texture_of(gltf, bin, use, decoded),
        set: use.texCoord === 1 ? 1 : 0,
        scale: use.scale ?? 1,
        strength: use.strength ?? 1,
      };
  return {
    maps,
    metallic: surface?.metallicFactor ?? 1,
    roughness: surface?.roughnessFactor ?? 1,
    emitted: (material?.emissiveFactor ?? [0, 0, 0]).map((value) => value * strength),
    coat: layer.clearcoatFactor ?? 0,
    coat_roughness: layer.clearcoatRoughnessFactor ?? 0,
  };
}

/**
 * Returns the meshes [{name, cut, matrix, positions, normals, tangents, uvs, second_uvs, indices, base, texture, cut_below, is_unlit, metallic,
 * roughness, emitted, coat, coat_roughness, maps}] of a file's scene. `maps` are {picture, set, scale, strength} by name; `cut` is the plane that cuts it (cut.js), or null; `base` is
 * linear RGBA; where the texture's alpha is below `cut_below` the surface has holes; uvs and texture (a bitmap) may be null. Throws an Error whose message can be shown.
 */
export async function read_glb(buffer) {
  const [gltf, bin] = chunks_of(buffer);
  const meshes = [],
    decoded = new Map();
  const numbers_or_null = (index) => (index === undefined ? null : numbers_of(gltf, bin, index));
  const visit = (index, parent, above) => {
    const node = gltf.nodes[index],
      matrix = product(parent, matrix_of(node)),
      name = node.name ?? above,
      cut = node.extras?.cut ?? null;
    for (const primitive of node.mesh === undefined ? [] : gltf.meshes[node.mesh].primitives) {
      if ((primitive.mode ?? 4) !== 4) continue;
      const positions = numbers_of(gltf, bin, primitive.attributes.POSITION);
      const indices =
        primitive.indices === undefined
          ? Uint32Array.from({ length: positions.length / 3 }, (_, i) => i)
          : Uint32Array.from(numbers_of(gltf, bin, primitive.indices));
      const { NORMAL: normal, TANGENT: tangent, TEXCOORD_0: uv, TEXCOORD_1: second_uv } = primitive.attributes,
        whole = gltf.materials?.[primitive.material];
      const material = whole?.pbrMetallicRoughness;
      meshes.push({
        name,
        cut,
        matrix,
        positions,
        indices,
        base: material?.baseColorFactor ?? [1, 1, 1, 1],
        normals: normal === undefined ? normals_of(positions, indices) : numbers_of(gltf, bin, normal),
        tangents: numbers_or_null(tangent),
        uvs: numbers_or_null(uv),
        second_uvs: numbers_or_null(second_uv),
        texture: texture_of(gltf, bin, material?.baseColorTexture, decoded),
        material: whole,
        cut_below: whole?.alphaMode === "MASK" ? (whole.alphaCutoff ?? 0.5) : 0,
        is_unlit: whole?.extensions?.KHR_materials_unlit !== undefined,
      });
    }
    for (const child of node.children ?? []) visit(child, matrix, name);
  };
  const identity = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
  for (const root of gltf.scenes[gltf.scene ?? 0].nodes) visit(root, identity, "");
  for (const mesh of meshes) {
    mesh.texture = await mesh.texture;
    Object.assign(mesh, await material_of(gltf, bin, mesh.material, decoded));
  }
  return meshes;
}
