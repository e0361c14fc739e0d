#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <meshoptimizer.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/file.h"
#include "scene/meshes/mesh.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
using nlohmann::json;
namespace fs = std::filesystem;

// A glTF file that is put together piece by piece: a node with one mesh of one primitive.
struct Gltf {
  std::string bin;
  json root = {{"asset", {{"version", "2.0"}}},
               {"scene", 0},
               {"scenes", {{{"nodes", {0}}}}},
               {"nodes", {{{"mesh", 0}}}},
               {"meshes", {{{"primitives", {{{"attributes", json::object()}}}}}}},
               {"accessors", json::array()},
               {"bufferViews", json::array()}};

  json& primitive() { return root["meshes"][0]["primitives"][0]; }

  template <class T>
  int view(const std::vector<T>& values) {
    while (bin.size() % 4 != 0) bin += '\0';
    root["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", values.size() * sizeof(T)}});
    bin.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    return static_cast<int>(root["bufferViews"].size()) - 1;
  }

  template <class T>
  int accessor(const std::vector<T>& values,
               int component,
               const char* type,
               std::size_t count,
               bool normalised = false) {
    root["accessors"].push_back({{"bufferView", view(values)},
                                 {"componentType", component},
                                 {"type", type},
                                 {"count", count},
                                 {"normalized", normalised}});
    return static_cast<int>(root["accessors"].size()) - 1;
  }

  std::string glb() {
    root["buffers"] = {{{"byteLength", bin.size()}}};
    std::string text = root.dump();
    while (text.size() % 4 != 0) text += ' ';
    while (bin.size() % 4 != 0) bin += '\0';
    std::string out = "glTF";
    const auto put = [&](std::size_t value) {
      const auto number = static_cast<std::uint32_t>(value);
      out.append(reinterpret_cast<const char*>(&number), 4);
    };
    put(2), put(28 + text.size() + bin.size()), put(text.size());
    out += "JSON" + text;
    put(bin.size());
    return out + std::string("BIN\0", 4) + bin;
  }
};

// The corners of a plate of 100 x 80 mm, in metres.
const std::vector<float> k_corners = {0, 0, 0, 0.1F, 0, 0, 0.1F, 0.08F, 0, 0, 0.08F, 0};

Gltf plate() {
  Gltf file;
  file.primitive()["attributes"]["POSITION"] = file.accessor(k_corners, 5126, "VEC3", 4);
  file.primitive()["indices"] = file.accessor(std::vector<std::uint8_t>{0, 1, 2, 0, 2, 3}, 5121, "SCALAR", 6);
  return file;
}

fs::path written(const std::string& name, const std::string& content) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  const fs::path path =
      fs::temp_directory_path() / ("limn-gltf-" + std::to_string(getpid())) / test->name() / name;
  fs::create_directories(path.parent_path());
  EXPECT_TRUE(write_file(path, content));
  return path;
}

std::string g_messages;  // what the last loaded() printed

Mesh loaded(const std::string& content, const std::string& name = "part.glb") {
  const fs::path path = written(name, content);
  testing::internal::CaptureStderr();
  auto mesh = load_mesh(path, std::nullopt);
  g_messages = testing::internal::GetCapturedStderr();
  EXPECT_TRUE(mesh) << mesh.message();
  return mesh ? *mesh : Mesh{};
}

std::string error_of(const std::string& content, const std::string& name = "part.glb") {
  const auto mesh = load_mesh(written(name, content), std::nullopt);
  return mesh ? "(no error)" : mesh.message();
}

testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << part << "' is not in: " << text;
}

Eigen::AlignedBox3d box_mm(const Mesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Vector3f& p : mesh.positions) box.extend(1e3 * p.cast<double>());
  return box;
}

testing::AssertionResult is_plate(const Mesh& mesh, double tolerance_mm = 1e-3) {
  const Eigen::AlignedBox3d box = box_mm(mesh);
  if (mesh.triangles.size() != 2) return testing::AssertionFailure() << mesh.triangles.size() << " triangles";
  if (box.isEmpty()) return testing::AssertionFailure() << "nothing";
  if (auto low = test::near(box.min(), Vector3d(0, 0, 0), tolerance_mm); !low) return low;
  return test::near(box.max(), Vector3d(100, 80, 0), tolerance_mm);
}

Vector3d colour_at(const Mesh& mesh, const Vector3d& p_mm) {
  for (std::size_t i = 0; i < mesh.positions.size() && !mesh.colours.empty(); ++i)
    if ((1e3 * mesh.positions[i].cast<double>() - p_mm).norm() < 0.01) return mesh.colours[i].cast<double>();
  return Vector3d::Constant(-1);
}

std::string png(const cv::Scalar& bgr, const char* format = ".png") {
  std::vector<std::uint8_t> bytes;
  cv::imencode(format, cv::Mat(4, 4, CV_8UC3, bgr), bytes);
  return {bytes.begin(), bytes.end()};
}

// Gives the plate a material with a base colour texture from this image.
void add_texture(Gltf* file, const json& image, const json& texture = {{"source", 0}}) {
  file->primitive()["attributes"]["TEXCOORD_0"] =
      file->accessor(std::vector<float>{0, 1, 1, 1, 1, 0, 0, 0}, 5126, "VEC2", 4);
  file->primitive()["material"] = 0;
  file->root["materials"] = json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}});
  file->root["textures"] = json::array({texture});
  file->root["images"] = json::array({image});
}

cv::Vec3b texel(const Mesh& mesh) {
  return mesh.materials.at(mesh.triangle_materials.at(0)).texture.at<cv::Vec3b>(1, 1);
}

TEST(GltfMesh, UrisArePercentDecodedOrData) {
  Gltf file = plate();
  add_texture(&file, {{"uri", "my%20textures/wood%20gr%C3%BCn.png"}});
  written("my textures/wood gr\xc3\xbcn.png", png({10, 20, 30}));
  file.root["buffers"] = {{{"byteLength", file.bin.size()}, {"uri", "side%20mirror.bin"}}};
  written("side mirror.bin", file.bin);
  const Mesh outside = loaded(file.root.dump(), "side mirror.gltf");
  EXPECT_TRUE(is_plate(outside));
  EXPECT_EQ(texel(outside), cv::Vec3b(10, 20, 30));
  std::string encoded;
  for (const char c : file.bin) encoded += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  file.root["buffers"][0]["uri"] = "data:application/octet-stream," + encoded;
  EXPECT_TRUE(is_plate(loaded(file.root.dump(), "inside.gltf")));
  file.root["buffers"][0]["uri"] = "gone%20away.bin";
  EXPECT_TRUE(contains(error_of(file.root.dump(), "gone.gltf"), "expected its buffer file gone away.bin"));
}

TEST(GltfMesh, QuantisedAndInterleavedAccessorsAreRead) {
  Gltf file = plate();
  file.root["extensionsRequired"] = {"KHR_mesh_quantization"};
  // Positions from -1 to 1 in 16 bits, then normals in 8 bits, 12 bytes for each vertex; the node scales and
  // moves.
  std::string bytes;
  for (const auto& [x, y] : {std::pair{-32767, -32767}, {32767, -32767}, {32767, 32767}, {-32767, 32767}}) {
    const std::int16_t p[4] = {static_cast<std::int16_t>(x), static_cast<std::int16_t>(y), 0, 0};
    const std::int8_t n[4] = {0, 0, 127, 0};
    bytes.append(reinterpret_cast<const char*>(p), 8).append(reinterpret_cast<const char*>(n), 4);
  }
  const int view = file.view(std::vector<char>(bytes.begin(), bytes.end()));
  file.root["bufferViews"][view]["byteStride"] = 12;
  file.root["accessors"][0] = {
      {"bufferView", view}, {"componentType", 5122}, {"type", "VEC3"}, {"count", 4}, {"normalized", true}};
  file.root["accessors"].push_back({{"bufferView", view},
                                    {"byteOffset", 8},
                                    {"componentType", 5120},
                                    {"type", "VEC3"},
                                    {"count", 4},
                                    {"normalized", true}});
  file.primitive()["attributes"]["NORMAL"] = 2;
  file.root["nodes"][0].update({{"scale", {0.05, 0.04, 1}}, {"translation", {0.05, 0.04, 0}}});
  const Mesh mesh = loaded(file.glb());
  EXPECT_TRUE(is_plate(mesh));
  for (const Vector3f& n : mesh.normals) EXPECT_NEAR(n.z(), 1, 1e-6);
}

TEST(GltfMesh, BuffersCompressedByMeshoptAreRead) {
  Gltf file = plate();
  file.root["extensionsRequired"] = {"EXT_meshopt_compression"};
  std::vector<unsigned char> vertices(meshopt_encodeVertexBufferBound(4, 12)),
      indices(meshopt_encodeIndexBufferBound(6, 4));
  vertices.resize(meshopt_encodeVertexBuffer(vertices.data(), vertices.size(), k_corners.data(), 4, 12));
  const unsigned triangles[] = {0, 1, 2, 0, 2, 3};
  indices.resize(meshopt_encodeIndexBuffer(indices.data(), indices.size(), triangles, 6));
  const auto compress = [&](int view, std::vector<unsigned char> bytes, json how) {
    const std::size_t at = file.bin.size();
    file.bin.append(bytes.begin(), bytes.end());
    how.update({{"buffer", 0}, {"byteOffset", at}, {"byteLength", bytes.size()}});
    file.root["bufferViews"][view] = {
        {"buffer", 1}, {"byteLength", 48}, {"extensions", {{"EXT_meshopt_compression", how}}}};
  };
  compress(0, vertices, {{"mode", "ATTRIBUTES"}, {"byteStride", 12}, {"count", 4}});
  compress(1, indices, {{"mode", "TRIANGLES"}, {"byteStride", 4}, {"count", 6}});
  file.root["accessors"][1]["componentType"] = 5125;
  EXPECT_TRUE(is_plate(loaded(file.glb())));
  file.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["byteLength"] = 20;
  EXPECT_TRUE(contains(error_of(file.glb()), "EXT_meshopt_compression, found damaged ones"));
  file.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["byteStride"] = 10;
  EXPECT_TRUE(contains(error_of(file.glb()), "as EXT_meshopt_compression says"));
}

TEST(GltfMesh, DracoMeshesAreRead) {
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(2);
  const int positions = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const std::array<std::array<float, 3>, 4> p = {{{0, 0, 0}, {0.1F, 0, 0}, {0.1F, 0.08F, 0}, {0, 0.08F, 0}}};
  builder.SetAttributeValuesForFace(positions, draco::FaceIndex(0), p[0].data(), p[1].data(), p[2].data());
  builder.SetAttributeValuesForFace(positions, draco::FaceIndex(1), p[0].data(), p[2].data(), p[3].data());
  const auto mesh = builder.Finalize();
  draco::Encoder encoder;
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
  draco::EncoderBuffer buffer;
  ASSERT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
  Gltf file = plate();
  file.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  const int view = file.view(std::vector<char>(buffer.data(), buffer.data() + buffer.size()));
  for (json& accessor : file.root["accessors"]) accessor.erase("bufferView");
  file.primitive()["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", view},
                                                                  {"attributes", {{"POSITION", 0}}}};
  EXPECT_TRUE(is_plate(loaded(file.glb()), 0.02));
  file.root["bufferViews"][view]["byteLength"] = 10;
  EXPECT_TRUE(contains(error_of(file.glb()), "Draco's compression"));
}

TEST(GltfMesh, ColoursOfVerticesAreLinear) {
  const auto colours_of = [](auto values, int component, const char* type, bool normalised) {
    Gltf file = plate();
    file.primitive()["attributes"]["COLOR_0"] = file.accessor(values, component, type, 4, normalised);
    return loaded(file.glb());
  };
  const Mesh bytes =
      colours_of(std::vector<std::uint8_t>{255, 0, 0, 255, 0, 51, 0, 255, 0, 0, 255, 255, 102, 102, 102, 255},
                 5121, "VEC4", true);
  EXPECT_TRUE(test::near(colour_at(bytes, {0, 0, 0}), Vector3d(1, 0, 0), 1e-6));
  EXPECT_TRUE(test::near(colour_at(bytes, {100, 0, 0}), Vector3d(0, 0.2, 0), 1e-6));
  const Mesh floats =
      colours_of(std::vector<float>{1, 0, 0, 0, 0.2F, 0, 0, 0, 1, 0.4F, 0.4F, 0.4F}, 5126, "VEC3", false);
  EXPECT_TRUE(test::near(colour_at(floats, {100, 0, 0}), Vector3d(0, 0.2, 0), 1e-6));
  const Mesh shorts =
      colours_of(std::vector<std::uint16_t>{65535, 0, 0, 0, 0, 13107, 0, 0, 0, 0, 65535, 0, 1, 1, 1, 0}, 5123,
                 "VEC4", true);
  EXPECT_TRUE(test::near(colour_at(shorts, {100, 0, 0}), Vector3d(0, 0.2, 0), 1e-6));
}

TEST(GltfMesh, DefaultMorphWeightsAreApplied) {
  Gltf file = plate();
  const std::vector<float> stretch = {0, 0, 0, 0.1F, 0, 0, 0.1F, 0, 0, 0, 0, 0};
  file.primitive()["targets"] = {{{"POSITION", file.accessor(stretch, 5126, "VEC3", 4)}}};
  EXPECT_NEAR(box_mm(loaded(file.glb())).max().x(), 100, 1e-3);  // the default weight is 0
  file.root["meshes"][0]["weights"] = {1.0};
  EXPECT_NEAR(box_mm(loaded(file.glb())).max().x(), 200, 1e-3);
  file.root["nodes"][0]["weights"] = {0.5};  // the node's win
  EXPECT_NEAR(box_mm(loaded(file.glb())).max().x(), 150, 1e-3);
}

// Two joints; the second one, which carries the right side, is raised by 30 mm. The mesh's own node is
// ignored.
TEST(GltfMesh, SkinsStandInThePoseOfTheirNodes) {
  Gltf file = plate();
  file.primitive()["attributes"]["JOINTS_0"] = file.accessor(
      std::vector<std::uint8_t>{0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}, 5121, "VEC4", 4);
  file.primitive()["attributes"]["WEIGHTS_0"] =
      file.accessor(std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, 5126, "VEC4", 4);
  std::vector<float> inverse;
  for (const float x : {0.F, -0.1F})
    inverse.insert(inverse.end(), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, 0, 0, 1});
  file.root["skins"] = {
      {{"joints", {1, 2}}, {"inverseBindMatrices", file.accessor(inverse, 5126, "MAT4", 2)}}};
  file.root["nodes"] = {{{"mesh", 0}, {"skin", 0}, {"translation", {5, 5, 5}}},
                        {{"children", {2}}},
                        {{"translation", {0.1, 0, 0.03}}}};
  file.root["scenes"][0]["nodes"] = {0, 1};
  const Eigen::AlignedBox3d box = box_mm(loaded(file.glb()));
  EXPECT_TRUE(test::near(box.min(), Vector3d(0, 0, 0), 1e-3));
  EXPECT_TRUE(test::near(box.max(), Vector3d(100, 80, 30), 1e-3));
}

TEST(GltfMesh, SparseAccessorsStripsFansAndInstancesAreRead) {
  Gltf file = plate();
  const int at = file.view(std::vector<std::uint16_t>{1, 2}),
            with = file.view(std::vector<float>{0.2F, 0, 0, 0.2F, 0.08F, 0});
  file.root["accessors"][0]["sparse"] = {{"count", 2},
                                         {"indices", {{"bufferView", at}, {"componentType", 5123}}},
                                         {"values", {{"bufferView", with}}}};
  EXPECT_NEAR(box_mm(loaded(file.glb())).max().x(), 200, 1e-3);
  for (const auto& [mode, order] : {std::pair{5, std::vector<std::uint8_t>{0, 1, 3, 2}}, {6, {0, 1, 2, 3}}}) {
    Gltf other = plate();
    other.primitive()["indices"] = other.accessor(order, 5121, "SCALAR", 4);
    other.primitive()["mode"] = mode;
    const Mesh mesh = loaded(other.glb());
    EXPECT_TRUE(is_plate(mesh)) << mode;
    for (const Vector3f& n : mesh.normals) EXPECT_NEAR(n.z(), 1, 1e-6) << mode;
  }
  Gltf twice = plate();
  twice.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] =
      twice.accessor(std::vector<float>{0, 0, 0, 0.2F, 0, 0}, 5126, "VEC3", 2);
  EXPECT_NEAR(box_mm(loaded(twice.glb())).max().x(), 300, 1e-3);
}

TEST(GltfMesh, SpecularGlossinessBecomesTheBaseColour) {
  Gltf file = plate();
  file.primitive()["material"] = 0;
  file.root["extensionsUsed"] = {"KHR_materials_pbrSpecularGlossiness"};
  file.root["materials"] =
      json::array({{{"extensions",
                     {{"KHR_materials_pbrSpecularGlossiness",
                       {{"diffuseFactor", {0.8, 0.1, 0.2, 1}}, {"glossinessFactor", 0.25}}}}}}});
  const Material material = loaded(file.glb()).materials.at(0);
  EXPECT_TRUE(test::near(material.base_colour.cast<double>(), Vector3d(0.8, 0.1, 0.2), 1e-6));
  EXPECT_EQ(material.metallic, 0);
  EXPECT_NEAR(material.roughness, 0.75, 1e-6);
  add_texture(&file, {{"uri", "red.png"}});
  written("red.png", png({0, 0, 200}));
  file.root["materials"] = json::array(
      {{{"extensions", {{"KHR_materials_pbrSpecularGlossiness", {{"diffuseTexture", {{"index", 0}}}}}}}}});
  EXPECT_EQ(texel(loaded(file.glb())), cv::Vec3b(0, 0, 200));
}

TEST(GltfMesh, WebpIsShownAndKtx2IsNamed) {
  Gltf file = plate();
  file.root["extensionsRequired"] = {"EXT_texture_webp"};
  const std::string webp = png({40, 40, 200}, ".webp");
  const int view = file.view(std::vector<char>(webp.begin(), webp.end()));
  add_texture(&file, {{"bufferView", view}, {"mimeType", "image/webp"}},
              {{"extensions", {{"EXT_texture_webp", {{"source", 0}}}}}});
  const cv::Vec3b red = texel(loaded(file.glb()));
  EXPECT_NEAR(red[2], 200, 6);
  EXPECT_NEAR(red[0], 40, 6);
  Gltf ktx = plate();
  ktx.root["extensionsRequired"] = {"KHR_texture_basisu"};
  written("wood.ktx2", "\xabKTX 20\xbb\r\n\x1a\n" + std::string(60, '\0'));
  add_texture(&ktx, {{"uri", "wood.ktx2"}}, {{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}});
  EXPECT_TRUE(contains(error_of(ktx.glb()), "KHR_texture_basisu"));
  EXPECT_TRUE(contains(error_of(ktx.glb()), "Switch KTX2 or Basis Universal off"));
}

// Some programs do not fill the text of a .glb up to four bytes.
TEST(GltfMesh, AnUnalignedGlbIsRead) {
  std::string bytes = plate().glb();
  const std::size_t end = bytes.rfind('}') + 1, bin = bytes.find(std::string("BIN\0", 4)) - 4;
  bytes.insert(end, " ");  // the text ends at an odd place
  const auto put = [&](std::size_t at, std::size_t value) {
    const auto number = static_cast<std::uint32_t>(value);
    std::memcpy(&bytes[at], &number, 4);
  };
  put(8, bytes.size());
  put(12, bin + 1 - 20);
  EXPECT_TRUE(is_plate(loaded(bytes)));
}

TEST(GltfMesh, ExtensionsThatAreNotReadAreNamed) {
  Gltf file = plate();
  file.root["extensionsRequired"] = {"ACME_secret_geometry"};
  EXPECT_TRUE(contains(error_of(file.glb()), "found ACME_secret_geometry. Switch ACME_secret_geometry off"));
  Gltf velvet = plate();
  velvet.primitive()["material"] = 0;
  velvet.root["materials"] =
      json::array({{{"extensions", {{"KHR_materials_sheen", {{"sheenRoughnessFactor", 1}}}}}}});
  loaded(velvet.glb());
  EXPECT_TRUE(contains(g_messages, "its materials are shown without KHR_materials_sheen"));
}

TEST(GltfMesh, DamagedFilesAreErrorsThatNameThem) {
  const auto broken = [](const std::function<void(json*)>& change) {
    Gltf file = plate();
    change(&file.root);
    return error_of(file.glb());
  };
  EXPECT_TRUE(contains(broken([](json* r) { (*r)["accessors"][0]["count"] = 400; }),
                       "part.glb: expected a buffer of"));
  EXPECT_TRUE(contains(broken([](json* r) { (*r)["accessors"][0]["count"] = -4; }), "not a whole number"));
  EXPECT_TRUE(contains(broken([](json* r) { (*r)["accessors"][0]["type"] = "VEC9"; }), "accessor 0"));
  EXPECT_TRUE(contains(broken([](json* r) { (*r)["meshes"] = json::array(); }), "in the form of glTF 2.0"));
  EXPECT_TRUE(contains(broken([](json* r) { (*r)["nodes"][0]["children"] = {0}; }), "its own child"));
  EXPECT_TRUE(
      contains(broken([](json* r) { (*r)["bufferViews"][0]["buffer"] = 7; }), "in the form of glTF 2.0"));
  const std::string whole = plate().glb();
  EXPECT_TRUE(contains(error_of(whole.substr(0, whole.size() - 4)), "ends too early"));
}

}  // namespace
}  // namespace limn::scene
