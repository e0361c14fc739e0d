// glTF's KHR_materials_variants and KHR_materials_clearcoat.
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/file.h"
#include "scene/meshes/glb.h"
#include "scene/meshes/mesh_from_content.h"
#include "scene/meshes/tangents.h"
#include "scene/scene.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using Eigen::Vector3d;
using nlohmann::json;
namespace fs = std::filesystem;

// A triangle with a red material, and a blue one for its variants "midnight" and "beach/sand".
json shoe() {
  const std::vector<float> corners = {0, 0, 0, 0.2F, 0, 0, 0, 0.1F, 0};
  std::string text;
  for (const float corner : corners) {
    std::array<unsigned char, 4> bytes{};
    std::memcpy(bytes.data(), &corner, 4);
    for (const unsigned char byte : bytes) text += fmt::format("%{:02x}", byte);
  }
  return json::parse(R"({"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    "extensionsUsed":["KHR_materials_variants"],
    "extensions":{"KHR_materials_variants":{"variants":[{"name":"midnight"},{"name":"beach/sand"}]}},
    "materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0,0,1]}},
                 {"pbrMetallicRoughness":{"baseColorFactor":[0,0,1,1]}}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0,"extensions":{"KHR_materials_variants":
      {"mappings":[{"material":1,"variants":[0]}]}}}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
    "bufferViews":[{"buffer":0,"byteLength":36}],
    "buffers":[{"byteLength":36,"uri":"data:application/octet-stream,)" +
                     text + R"("}]})");
}

Eigen::Vector3f colour_of(const Mesh& mesh) {
  return mesh.materials[mesh.triangle_materials.at(0)].base_colour;
}

Result<MeshWithVariants> loaded(const json& file) {
  const fs::path path = test::test_folder() / "shoe.gltf";
  EXPECT_TRUE(write_file(path, file.dump()));
  return load_mesh_with_variants(path, std::nullopt);
}

TEST(MaterialVariants, AreMeshesOfTheSameShapeWithOtherMaterials) {
  const auto meshes = loaded(shoe());
  ASSERT_TRUE(meshes) << meshes.message();
  EXPECT_EQ(colour_of(meshes->mesh), Eigen::Vector3f(1, 0, 0));
  ASSERT_EQ(meshes->variants.size(), 2U);
  EXPECT_EQ(meshes->variants[0].name, "midnight");
  EXPECT_EQ(colour_of(meshes->variants[0].mesh), Eigen::Vector3f(0, 0, 1));
  EXPECT_EQ(meshes->variants[0].mesh.positions, meshes->mesh.positions);
  // What a variant does not mention keeps its own material.
  EXPECT_EQ(colour_of(meshes->variants[1].mesh), Eigen::Vector3f(1, 0, 0));
}

TEST(MaterialVariants, NamesAreMadeDistinct) {
  json file = shoe();
  file["extensions"]["KHR_materials_variants"]["variants"] = {
      {{"name", "red"}}, {{"name", "red"}}, json::object()};
  const auto meshes = loaded(file);
  ASSERT_TRUE(meshes) << meshes.message();
  std::vector<std::string> names;
  for (const auto& variant : meshes->variants) names.push_back(variant.name);
  EXPECT_EQ(names, (std::vector<std::string>{"red", "red 2", "variant 3"}));
}

TEST(MaterialVariants, BecomeVariantsOfTheSlotUnderTheNameOfTheirFile) {
  const fs::path folder = test::test_folder();
  const json scene = {
      {"schema", "limn.scene/1"},
      {"slots",
       {{{"name", "foot"},
         {"marker", "apriltag_36h11:3"},
         {"size_mm", 30},
         {"marker_from_part", {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0, 0, 0}}}},
         {"variants",
          {{{"name", "own"}, {"mesh", "own.gltf"}}, {{"name", "own beach-sand"}, {"mesh", "own.gltf"}}}}}}}};
  fs::create_directories(folder / "slots/foot");
  ASSERT_TRUE(write_file(folder / "scene.json", scene.dump()));
  for (const char* file : {"own.gltf", "slots/foot/shoe.gltf"})
    ASSERT_TRUE(write_file(folder / file, shoe().dump()));
  testing::internal::CaptureStderr();
  const auto found = load_scene(folder);
  const std::string messages = testing::internal::GetCapturedStderr();
  ASSERT_TRUE(found) << found.message();
  std::vector<std::string> names;
  for (const Variant& variant : found->slots.at(0).variants) names.push_back(variant.name);
  EXPECT_EQ(names, (std::vector<std::string>{"own", "own midnight", "own beach-sand",
                                             "own beach-sand midnight", "own beach-sand beach-sand", "shoe",
                                             "shoe midnight", "shoe beach-sand"}));
  EXPECT_EQ(colour_of(found->slots[0].variants[6].mesh), Eigen::Vector3f(0, 0, 1));
  EXPECT_EQ(found->slots[0].variants[6].default_variant, "shoe");
  EXPECT_TRUE(found->slots[0].variants[5].default_variant.empty());
  // The scene's own name wins over that of a material variant.
  EXPECT_NE(messages.find("material variant 'beach/sand'"), std::string::npos) << messages;
}

TEST(MaterialVariants, DamagedDataIsAnErrorThatSaysWhatIsWrong) {
  const auto message = [](const std::function<void(json*, json*)>& damage) {
    json file = shoe();
    damage(&file["extensions"]["KHR_materials_variants"],
           &file["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"]);
    const auto meshes = loaded(file);
    return meshes ? std::string("(no error)") : meshes.message();
  };
  const auto expect = [](const std::string& found, const char* words) {
    EXPECT_NE(found.find(words), std::string::npos) << words << " in: " << found;
  };
  expect(message([](json*, json* use) { (*use)["mappings"][0]["material"] = 2; }),
         "expected one of 2 materials, found number 2");
  expect(message([](json*, json* use) { (*use)["mappings"][0]["variants"] = {5}; }),
         "expected one of 2 variants, found number 5");
  expect(message([](json*, json* use) { *use = 7; }),
         "expected KHR_materials_variants with a list \"mappings\"");
  expect(message([](json* names, json*) { *names = json::object(); }), "with a list \"variants\"");
  expect(message([](json* names, json*) { (*names)["variants"][0]["name"] = 3; }), "in the form of glTF 2.0");
  expect(message([](json* names, json*) { (*names)["variants"] = std::vector<json>(65, json::object()); }),
         "at most 64 variants, found 65");
}

// A triangle with two sets of coordinates; its materials have a texture in set 0, in set 1, none, and in set
// 2, which the triangle does not have.
MeshContent content_with(const std::vector<std::size_t>& variant_materials) {
  MeshContent content;
  content.metres_per_unit = 1;
  content.images.push_back({{}, cv::Mat(4, 4, CV_8UC4, cv::Scalar(10, 20, 30, 255))});
  MeshPiece piece;
  piece.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  piece.uvs = {{0, 0}, {1, 0}, {0, 1}};
  piece.more_uvs[1] = {{0.5F, 0}, {0.5F, 1}, {0, 0.25F}};
  piece.triangles = {{0, 1, 2}};
  piece.variant_materials = variant_materials;
  content.pieces.push_back(piece);
  for (const int set : {0, 1, -1, 2}) {
    MaterialSource material;
    if (set >= 0) material.base.embedded = 0;
    if (set >= 0) material.base.place.coordinates = set;
    content.materials.push_back(material);
  }
  for (const std::size_t material : variant_materials)
    content.variants.push_back(fmt::format("variant {}", material));
  return content;
}

TEST(MaterialVariants, HaveTheCoordinatesOfTheirOwnTextures) {
  const auto content = content_with({1, 2, 0, 1});
  const auto meshes = meshes_from_content(content, "shoe.glb", std::nullopt);
  ASSERT_TRUE(meshes) << meshes.message();
  const MeshPiece& piece = content.pieces[0];
  ASSERT_EQ(meshes->variants.size(), 4U);
  EXPECT_EQ(meshes->mesh.uvs, piece.uvs);
  EXPECT_EQ(meshes->variants[0].mesh.uvs, piece.more_uvs.at(1));
  EXPECT_EQ(meshes->variants[2].mesh.uvs, piece.uvs);
  EXPECT_EQ(meshes->variants[3].mesh.uvs, piece.more_uvs.at(1));
  for (std::size_t i = 0; i < 4; ++i) {
    const Mesh& mesh = meshes->variants[i].mesh;
    EXPECT_EQ(mesh.positions, piece.positions);
    EXPECT_EQ(mesh.triangle_materials.at(0), piece.variant_materials[i]);
    EXPECT_EQ(mesh.materials[piece.variant_materials[i]].texture.empty(), i == 1);
  }
}

TEST(MaterialVariants, AWarningIsGivenOnce) {
  testing::internal::CaptureStderr();
  const auto meshes = meshes_from_content(content_with({3, 0, 3}), "shoe.glb", std::nullopt);
  const std::string messages = testing::internal::GetCapturedStderr();
  ASSERT_TRUE(meshes) << meshes.message();
  const char* words = "expected texture coordinates";
  const std::size_t first = messages.find(words);
  ASSERT_NE(first, std::string::npos) << messages;
  EXPECT_EQ(messages.find(words, first + 1), std::string::npos) << messages;
}

TEST(MaterialVariants, TooManyTrianglesInAllOfThemAreRefusedByName) {
  MeshContent content = content_with(std::vector<std::size_t>(64, 0));
  content.pieces[0].triangles.resize(400'000, {0, 1, 2});
  const auto meshes = meshes_from_content(content, "shoe.glb", std::nullopt);
  ASSERT_FALSE(meshes);
  EXPECT_NE(meshes.message().find("found 400000 in each of 65"), std::string::npos) << meshes.message();
  EXPECT_NE(meshes.message().find("(variant 0, variant 0"), std::string::npos) << meshes.message();
}

TEST(MaterialVariants, ThoseOfAPrototypeAreNotUsedAndAMessageSaysSo) {
  const fs::path folder = test::test_folder();
  const json scene = {
      {"schema", "limn.scene/1"}, {"prototype", {{"mesh", "shoe.gltf"}}}, {"slots", json::array()}};
  ASSERT_TRUE(write_file(folder / "scene.json", scene.dump()));
  ASSERT_TRUE(write_file(folder / "shoe.gltf", shoe().dump()));
  testing::internal::CaptureStderr();
  const auto found = load_scene(folder);
  const std::string messages = testing::internal::GetCapturedStderr();
  ASSERT_TRUE(found) << found.message();
  EXPECT_EQ(colour_of(found->prototype->mesh), Eigen::Vector3f(1, 0, 0));
  EXPECT_NE(messages.find("its 2 material variants are not used here"), std::string::npos) << messages;
}

TEST(MaterialVariants, AMessageDoesNotRepeatAWholeExtension) {
  json file = shoe();
  std::string long_name = "x";
  for (int i = 0; i < 5000; ++i) long_name += "\u00e4";  // two bytes
  file["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"] = {{"mapping", long_name}};
  const auto meshes = loaded(file);
  ASSERT_FALSE(meshes);
  EXPECT_LT(meshes.message().size(), 400U + test::test_folder().string().size());
  EXPECT_NE(meshes.message().find("\u00e4..."), std::string::npos) << meshes.message();
}

std::string g_messages;

Result<Material> material_with(const json& extensions) {
  json file = shoe();
  file["materials"][0]["extensions"] = extensions;
  file["materials"][0]["emissiveFactor"] = {1, 0.5, 0};
  testing::internal::CaptureStderr();
  const auto meshes = loaded(file);
  g_messages = testing::internal::GetCapturedStderr();
  if (!meshes) return meshes.error();
  return meshes->mesh.materials[meshes->mesh.triangle_materials.at(0)];
}

TEST(Clearcoat, FactorsAreReadAndWrongOnesAreTold) {
  const auto coated = material_with(
      {{"KHR_materials_clearcoat", {{"clearcoatFactor", 0.75}, {"clearcoatRoughnessFactor", 0.25}}},
       {"KHR_materials_emissive_strength", {{"emissiveStrength", 4}}}});
  ASSERT_TRUE(coated) << coated.message();
  EXPECT_EQ(g_messages, "");
  EXPECT_EQ(coated->coat.factor, 0.75F);
  EXPECT_EQ(coated->coat.roughness, 0.25F);
  EXPECT_TRUE(test::near(coated->emitted.cast<double>(), Vector3d(4, 2, 0), 1e-6));
  const auto beyond = material_with({{"KHR_materials_clearcoat", {{"clearcoatFactor", 3}}},
                                     {"KHR_materials_emissive_strength", {{"emissiveStrength", -1}}}});
  ASSERT_TRUE(beyond) << beyond.message();
  EXPECT_EQ(beyond->coat.factor, 1);
  EXPECT_TRUE(beyond->emitted.isZero());
  for (const char* words : {"expected clearcoatFactor from 0 to 1, found 3. 1 is used",
                            "expected emissiveStrength from 0 to 1000000, found -1. 0 is used"})
    EXPECT_NE(g_messages.find(words), std::string::npos) << words << " in: " << g_messages;
}

TEST(Clearcoat, DamagedDataIsAnErrorThatSaysWhatIsWrong) {
  const auto message = [](const json& coat) {
    const auto material = material_with({{"KHR_materials_clearcoat", coat}});
    return material ? std::string("(no error)") : material.message();
  };
  const auto expect = [](const std::string& found, const char* words) {
    EXPECT_NE(found.find(words), std::string::npos) << words << " in: " << found;
  };
  expect(message(7), "expected an object as KHR_materials_clearcoat, found 7");
  expect(message({{"clearcoatFactor", "much"}}), "in the form of glTF 2.0");
  expect(message({{"clearcoatFactor", 1}, {"clearcoatTexture", 3}}),
         "expected an object as clearcoatTexture");
  expect(message({{"clearcoatFactor", 1}, {"clearcoatTexture", {{"index", 9}}}}), "in the form of glTF 2.0");
}

// A clear layer with all maps, some in the second coordinates, and strong emission come back from a file.
TEST(Clearcoat, IsWrittenToGlbAndComesBack) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {0.1F, 0, 0}, {0, 0.1F, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.uvs = {{0, 0}, {1, 0}, {0, 1}};
  mesh.second_uvs = {{0.5F, 0}, {0.5F, 1}, {0, 0.25F}};
  mesh.triangles = {{0, 1, 2}};
  mesh.triangle_materials = {0};
  const auto plain = [](const cv::Scalar& bgr, bool in_second_uvs) {
    return Texture{cv::Mat(4, 4, CV_8UC3, bgr), "", in_second_uvs};
  };
  Material& material = mesh.materials[0];
  material.texture = cv::Mat(4, 4, CV_8UC3, cv::Scalar(1, 2, 3));
  material.emitted = {3, 1.5F, 0};
  material.maps.occlusion = plain({0, 0, 9}, true);
  material.coat = {.factor = 0.5F, .roughness = 0.75F};
  material.coat.factor_map = plain({0, 0, 40}, true);
  material.coat.roughness_map = plain({0, 50, 0}, false);
  material.coat.normals = plain({255, 128, 140}, false);
  material.coat.normal_scale = 0.5F;
  add_tangents(&mesh);
  const GlbNode node{"part", &mesh, {}};
  const fs::path path = test::test_folder() / "coat.glb";
  ASSERT_TRUE(write_file(path, encode_glb(std::span(&node, 1))));
  testing::internal::CaptureStderr();
  const auto back = load_mesh(path, std::nullopt);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  ASSERT_TRUE(back) << back.message();
  const Material& found = back->materials[back->triangle_materials.at(0)];
  EXPECT_TRUE(test::near(found.emitted.cast<double>(), Vector3d(3, 1.5, 0), 1e-6));
  EXPECT_EQ(found.coat.factor, 0.5F);
  EXPECT_EQ(found.coat.roughness, 0.75F);
  EXPECT_EQ(found.coat.normal_scale, 0.5F);
  EXPECT_EQ(found.coat.factor_map.image.at<cv::Vec3b>(0, 0), cv::Vec3b(0, 0, 40));
  EXPECT_EQ(found.coat.roughness_map.image.at<cv::Vec3b>(0, 0), cv::Vec3b(0, 50, 0));
  EXPECT_EQ(found.coat.normals.image.at<cv::Vec3b>(0, 0), cv::Vec3b(255, 128, 140));
  EXPECT_TRUE(found.coat.factor_map.in_second_uvs && found.maps.occlusion.in_second_uvs);
  EXPECT_FALSE(found.coat.roughness_map.in_second_uvs || found.coat.normals.in_second_uvs);
  ASSERT_EQ(back->second_uvs.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_TRUE(test::near(back->uvs[i].cast<double>(), mesh.uvs[i].cast<double>(), 1e-6));
    EXPECT_TRUE(test::near(back->second_uvs[i].cast<double>(), mesh.second_uvs[i].cast<double>(), 1e-6));
  }
  EXPECT_TRUE(test::near(back->tangents[0].cast<double>(), mesh.tangents[0].cast<double>(), 1e-5));
}

}  // namespace
}  // namespace limn::scene
