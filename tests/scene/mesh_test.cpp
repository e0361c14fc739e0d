#include "scene/meshes/mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cstring>
#include <limits>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "scene/meshes/glb.h"
#include "scene/meshes/mesh_bvh.h"
#include "scene/meshes/tangents.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;
namespace fs = std::filesystem;

fs::path written(const std::string& name, const std::string& content) {
  const fs::path path = fs::temp_directory_path() / ("limn-mesh-" + std::to_string(getpid())) / name;
  fs::create_directories(path.parent_path());
  EXPECT_TRUE(write_file(path, content));
  return path;
}

// Twelve outward triangles of a cube of side 2 around the origin, three corners each.
std::vector<std::array<Vector3f, 3>> cube() {
  std::vector<std::array<Vector3f, 3>> triangles;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.f, 1.f}) {
      const auto corner = [&](float u, float v) {
        Vector3f p;
        p[axis] = side;
        p[(axis + 1) % 3] = u * side;
        p[(axis + 2) % 3] = v;
        return p;
      };
      triangles.push_back({corner(-1, -1), corner(1, -1), corner(1, 1)});
      triangles.push_back({corner(-1, -1), corner(1, 1), corner(-1, 1)});
    }
  }
  return triangles;
}

std::string binary_stl(const std::vector<std::array<Vector3f, 3>>& triangles) {
  std::string bytes(80, ' ');
  const auto put = [&](const void* data, std::size_t size) {
    bytes.append(static_cast<const char*>(data), size);
  };
  const auto count = static_cast<std::uint32_t>(triangles.size());
  put(&count, 4);
  for (const auto& t : triangles) {
    const Vector3f n = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
    put(n.data(), 12);
    for (const Vector3f& p : t) put(p.data(), 12);
    put("\0\0", 2);
  }
  return bytes;
}

const char* k_quad_ply =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";

std::string base64(const std::string& bytes) {
  static const char* k_letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t v = 0;
    for (std::size_t k = 0; k < 3; ++k)
      v = v << 8 | (i + k < bytes.size() ? static_cast<std::uint8_t>(bytes[i + k]) : 0);
    for (std::size_t k = 0; k < 4; ++k)
      out += i + k <= bytes.size() ? k_letters[v >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

// One unlit, textured triangle in a node that is moved, rotated by 90 degrees about x and scaled by 2.
std::string textured_gltf(const std::string& image) {
  const float data[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, /* uv */ 0, 0, 1, 0, 0, 1};
  const std::string buffer(reinterpret_cast<const char*>(data), sizeof(data));
  return R"({"asset":{"version":"2.0"},"extensionsUsed":["KHR_materials_unlit"],"scene":0,"scenes":[{"nodes":[0]}],
"nodes":[{"translation":[10,20,30],"children":[1]},{"rotation":[0.7071067811865476,0,0,0.7071067811865476],"scale":[2,2,2],"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":0}]}],
"materials":[{"extensions":{"KHR_materials_unlit":{}},"pbrMetallicRoughness":{"metallicFactor":0.75,"roughnessFactor":0.25,"baseColorFactor":[0.25,0.5,0.75,1],"baseColorTexture":{"index":0}}}],
"textures":[{"source":0}],"images":[{)" +
         image + R"(}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24}],
"buffers":[{"byteLength":60,"uri":"data:application/octet-stream;base64,)" +
         base64(buffer) + R"("}]})";
}

std::string small_png() {
  cv::Mat image(2, 2, CV_8UC3, cv::Scalar(10, 20, 30));
  image.at<cv::Vec3b>(0, 1) = {200, 100, 50};
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  return {bytes.begin(), bytes.end()};
}

void expect_unit_outward_normals(const Mesh& mesh) {
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
  for (std::size_t i = 0; i < mesh.normals.size(); ++i) {
    EXPECT_NEAR(mesh.normals[i].norm(), 1, 1e-5);
    EXPECT_GT(mesh.normals[i].dot(mesh.positions[i]), 0);
  }
}

TEST(Mesh, StlCubeIsJoinedAndKeepsItsEdges) {
  const auto mesh = load_mesh(written("cube.stl", binary_stl(cube())), LengthUnit::millimetre);
  ASSERT_TRUE(mesh) << mesh.message();
  EXPECT_EQ(mesh->triangles.size(), 12u);
  EXPECT_EQ(mesh->positions.size(), 24u);  // three normals at each of eight corners
  EXPECT_NEAR(mesh->positions[0].cwiseAbs().maxCoeff(), 0.001, 1e-9);
  for (const Vector3f& n : mesh->normals) EXPECT_NEAR(n.cwiseAbs().maxCoeff(), 1, 1e-6);
  expect_unit_outward_normals(*mesh);
}

TEST(Mesh, StlSphereIsSmooth) {
  std::vector<std::array<Vector3f, 3>> triangles;
  constexpr int k_steps = 40;
  const auto at = [](int i, int j) {
    const double a = 2 * M_PI * (i % k_steps) / k_steps, b = M_PI * j / k_steps;
    const double ring = j == 0 || j == k_steps ? 0 : std::sin(b);
    return Vector3f(Vector3d(ring * std::cos(a), ring * std::sin(a), std::cos(b)).cast<float>());
  };
  for (int i = 0; i < k_steps; ++i) {
    for (int j = 0; j < k_steps; ++j) {
      if (j > 0) triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
      if (j + 1 < k_steps) triangles.push_back({at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)});
    }
  }
  const auto mesh = load_mesh(written("sphere.stl", binary_stl(triangles)), LengthUnit::metre);
  ASSERT_TRUE(mesh) << mesh.message();
  EXPECT_EQ(mesh->positions.size(), static_cast<std::size_t>(k_steps * (k_steps - 1) + 2));
  for (std::size_t i = 0; i < mesh->normals.size(); ++i)
    EXPECT_GT(mesh->normals[i].dot(mesh->positions[i]), 0.999f);
}

TEST(Mesh, GltfNodesUnlitAndEmbeddedTexture) {
  const auto path =
      written("part.gltf", textured_gltf(R"("uri":"data:image/png;base64,)" + base64(small_png()) + "\""));
  const auto mesh = load_mesh(path, LengthUnit::centimetre);
  ASSERT_TRUE(mesh) << mesh.message();
  ASSERT_EQ(mesh->positions.size(), 3u);
  // (0, 1, 0) is scaled by 2, rotated about x onto z and moved, in centimetres. No axis is swapped.
  bool found = false;
  for (std::size_t i = 0; i < 3; ++i) {
    if ((mesh->positions[i] - Vector3f(0.10f, 0.20f, 0.32f)).norm() > 1e-6f) continue;
    found = true;
    EXPECT_NEAR(mesh->uvs[i].y(), 0, 1e-6);  // v counts down in glTF and up in Mesh
  }
  EXPECT_TRUE(found);
  EXPECT_NEAR(mesh->normals[0].y(), -1, 1e-5);
  const Material& material = mesh->materials[mesh->triangle_materials[0]];
  EXPECT_TRUE(material.unlit);
  EXPECT_EQ(material.metallic, 0.75f);
  EXPECT_EQ(material.roughness, 0.25f);
  EXPECT_TRUE(test::near(material.base_colour.cast<double>(), Vector3d(0.25, 0.5, 0.75), 1e-6));
  ASSERT_EQ(material.texture.type(), CV_8UC3);
  EXPECT_EQ(material.texture.at<cv::Vec3b>(0, 1), cv::Vec3b(200, 100, 50));
}

TEST(Mesh, TextureBesideTheMeshOrAnErrorThatNamesIt) {
  const auto path = written("beside/part.gltf", textured_gltf(R"("uri":"paint.png")"));
  const auto missing = load_mesh(path, LengthUnit::metre);
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.message().find("paint.png"), std::string::npos) << missing.message();
  written("beside/paint.png", small_png());
  const auto mesh = load_mesh(path, LengthUnit::metre);
  ASSERT_TRUE(mesh) << mesh.message();
  EXPECT_EQ(mesh->materials[mesh->triangle_materials[0]].texture.cols, 2);
}

// textured_gltf with an alphaMode of glTF in its material.
std::string gltf_with(const std::string& alpha, const std::string& image) {
  std::string text = textured_gltf(image);
  const std::string before = R"("materials":[{)";
  return text.insert(text.find(before) + before.size(), alpha);
}

TEST(Mesh, AlphaOfATextureCutsOut) {
  // The left is transparent black, the right is half transparent, then opaque.
  cv::Mat image(1, 3, CV_8UC4, cv::Scalar(10, 200, 30, 255));
  image.at<cv::Vec4b>(0, 0) = {0, 0, 0, 0};
  image.at<cv::Vec4b>(0, 1) = {10, 200, 30, 100};
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  written("decal/paint.png", std::string(bytes.begin(), bytes.end()));
  const auto loaded = [&](const std::string& alpha) {
    const auto mesh =
        load_mesh(written("decal/part.gltf", gltf_with(alpha, R"("uri":"paint.png")")), LengthUnit::metre);
    EXPECT_TRUE(mesh) << mesh.message();
    return mesh->materials[mesh->triangle_materials[0]];
  };
  const Material opaque = loaded("");
  EXPECT_EQ(opaque.texture.type(), CV_8UC3);
  EXPECT_EQ(opaque.cut_below, 0);
  EXPECT_EQ(loaded(R"("alphaMode":"BLEND",)").cut_below, 0.5f);
  const Material masked = loaded(R"("alphaMode":"MASK","alphaCutoff":0.25,)");
  EXPECT_EQ(masked.cut_below, 0.25f);
  ASSERT_EQ(masked.texture.type(), CV_8UC4);
  EXPECT_EQ(masked.texture.at<cv::Vec4b>(0, 0),
            cv::Vec4b(10, 200, 30, 0));  // filtering must not mix black in
  EXPECT_EQ(masked.texture.at<cv::Vec4b>(0, 1), cv::Vec4b(10, 200, 30, 100));
  // A material that is transparent everywhere is shown as opaque.
  image.setTo(cv::Scalar(10, 200, 30, 100));
  cv::imencode(".png", image, bytes);
  written("decal/paint.png", std::string(bytes.begin(), bytes.end()));
  const Material thin = loaded(R"("alphaMode":"BLEND",)");
  EXPECT_EQ(thin.cut_below, 0);
  EXPECT_EQ(thin.texture.type(), CV_8UC3);
  written("decal/paint.png", small_png());  // without alpha
  EXPECT_EQ(loaded(R"("alphaMode":"MASK",)").cut_below, 0);
}

TEST(Mesh, TheBaseColoursAlphaMultipliesTheTextures) {
  cv::Mat image(1, 2, CV_8UC4, cv::Scalar(10, 200, 30, 255));
  image.at<cv::Vec4b>(0, 1)[3] = 100;
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  written("faint/paint.png", std::string(bytes.begin(), bytes.end()));
  const auto loaded = [&](const std::string& factor) {
    std::string text = gltf_with(R"("alphaMode":"MASK",)", R"("uri":"paint.png")");
    text.replace(text.find("0.75,1]"), 7, "0.75," + factor + "]");
    const auto mesh = load_mesh(written("faint/part.gltf", text), LengthUnit::metre);
    EXPECT_TRUE(mesh) << mesh.message();
    return mesh->materials[mesh->triangle_materials[0]];
  };
  EXPECT_EQ(loaded("1").cut_below, 0.5f);
  EXPECT_NEAR(loaded("0.8").cut_below, 0.625, 1e-6);  // relative to the texture's own alpha
  testing::internal::CaptureStderr();
  const Material faint = loaded("0.25");
  const std::string messages = testing::internal::GetCapturedStderr();
  EXPECT_EQ(faint.cut_below, 0);
  EXPECT_EQ(faint.texture.type(), CV_8UC3);
  for (const char* word : {"part.gltf", "alpha of 0.5", "opaque"})
    EXPECT_NE(messages.find(word), std::string::npos) << messages;
}

// textured_gltf with additions to its material, these images as textures 1 to 4, and a normal at each corner.
std::string gltf_with_maps(const std::string& more, const std::vector<std::string>& files) {
  std::string images = R"("uri":"paint.png")", textures = R"("textures":[{"source":0})";
  for (std::size_t i = 0; i < files.size(); ++i) {
    images += R"(},{"uri":")" + files[i] + "\"";
    textures += R"(,{"source":)" + std::to_string(i + 1) + "}";
  }
  std::string text = gltf_with(more, images);
  const std::string before = R"("textures":[{"source":0})";
  return text.replace(text.find(before), before.size(), textures);
}

std::string png_of(const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  return {bytes.begin(), bytes.end()};
}

TEST(Mesh, SurfaceMapsOfGltfAreRead) {
  const char* k_maps =
      R"("normalTexture":{"index":1,"scale":0.5},"occlusionTexture":{"index":2,"strength":0.75},
"emissiveTexture":{"index":3},"emissiveFactor":[1,0.5,0.25],)";
  std::string text = gltf_with_maps(k_maps, {"normals.png", "rough.png", "glow.png"});
  const std::string before = R"("metallicFactor")";
  text.insert(text.find(before), R"("metallicRoughnessTexture":{"index":2},)");
  written("maps/paint.png", small_png());
  written("maps/normals.png", png_of(cv::Mat(2, 2, CV_8UC3, cv::Scalar(255, 128, 128))));
  written("maps/rough.png", png_of(cv::Mat(2, 2, CV_8UC3, cv::Scalar(51, 102, 153))));
  written("maps/glow.png", png_of(cv::Mat(2, 2, CV_8U, cv::Scalar(77))));
  const auto mesh = load_mesh(written("maps/part.gltf", text), LengthUnit::metre);
  ASSERT_TRUE(mesh) << mesh.message();
  const Material& material = mesh->materials[mesh->triangle_materials[0]];
  EXPECT_EQ(material.maps.normals.image.at<cv::Vec3b>(0, 0), cv::Vec3b(255, 128, 128));
  EXPECT_EQ(material.maps.metallic_roughness.image.at<cv::Vec3b>(1, 1), cv::Vec3b(51, 102, 153));
  EXPECT_EQ(material.maps.occlusion.image.data,
            material.maps.metallic_roughness.image.data);  // the image is read only once
  EXPECT_EQ(material.maps.emission.image.at<cv::Vec3b>(0, 1), cv::Vec3b(77, 77, 77));
  EXPECT_NE(material.maps.normals.file.find("normals.png"), std::string::npos);
  EXPECT_EQ(material.maps.normal_scale, 0.5f);
  EXPECT_EQ(material.maps.occlusion_strength, 0.75f);
  EXPECT_EQ(material.emitted, Vector3f(1, 0.5f, 0.25f));
  EXPECT_EQ(mesh->tangents.size(), mesh->positions.size());
}

TEST(Mesh, MapsThatCannotBeReadAreToldAndLeftOut) {
  written("gone/paint.png", small_png());
  written("gone/torn.png", small_png().substr(0, 40));
  const auto loaded = [&](const std::string& maps, const std::string& file, std::string* messages) {
    const auto path = written("gone/part.gltf", gltf_with_maps(R"("name":"chrome",)" + maps, {file}));
    testing::internal::CaptureStderr();
    const auto mesh = load_mesh(path, LengthUnit::metre);
    *messages = testing::internal::GetCapturedStderr();
    EXPECT_TRUE(mesh) << mesh.message();
    return mesh->materials[mesh->triangle_materials[0]];
  };
  std::string messages;
  const auto expect_messages = [&](std::initializer_list<const char*> words) {
    for (const char* word : words)
      EXPECT_NE(messages.find(word), std::string::npos) << word << " in: " << messages;
  };
  EXPECT_TRUE(loaded(R"("normalTexture":{"index":1},)", "gone.png", &messages).maps.is_none());
  expect_messages({"gone/part.gltf", "'chrome'", "normal texture", "gone.png", "shown smooth"});
  EXPECT_TRUE(loaded(R"("occlusionTexture":{"index":1},)", "torn.png", &messages).maps.is_none());
  expect_messages({"gone/part.gltf", "'chrome'", "occlusion texture", "torn.png", "soft light everywhere"});
  // Without its texture an emissive material must not be white everywhere.
  EXPECT_TRUE(loaded(R"("emissiveFactor":[1,1,1],"emissiveTexture":{"index":1},)", "gone.png", &messages)
                  .emitted.isZero());
  expect_messages({"'chrome'", "emissive texture", "without light of its own"});
  EXPECT_FALSE(loaded(R"("emissiveFactor":[1,1,1],)", "paint.png", &messages).emitted.isZero());
  EXPECT_EQ(messages, "");
  loaded(R"("normalTexture":{"index":1,"texCoord":1},)", "paint.png", &messages);
  expect_messages({"'chrome'", "coordinates of set 1", "triangles without"});
}

// textured_gltf with this mapping of its base colour texture. Its second texture coordinates are the
// positions' numbers, read as pairs: (0, 0), (0, 1), (0, 0).
std::string placed_gltf(const std::string& place, const std::string& more = "") {
  std::string text = gltf_with_maps(more, {"paint.png"});
  const auto replace = [&](const std::string& before, const std::string& after) {
    text.replace(text.find(before), before.size(), after);
  };
  replace(R"("extensionsUsed":[)", R"("extensionsUsed":["KHR_texture_transform",)");
  replace(R"("baseColorTexture":{"index":0)", R"("baseColorTexture":{"index":0,)" + place);
  replace(R"("TEXCOORD_0":1)", R"("TEXCOORD_0":1,"TEXCOORD_1":2)");
  replace(R"(],
"bufferViews")",
          R"(,{"bufferView":0,"componentType":5126,"count":3,"type":"VEC2"}],
"bufferViews")");
  return text;
}

std::string moved(const std::string& how) {
  return R"("extensions":{"KHR_texture_transform":{)" + how + "}}";
}

// The uv of the corner at (x, y) in the mesh's own frame.
Vector2d uv_at(const Mesh& mesh, double x, double y) {
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    if (test::near(mesh.positions[i].cast<double>(), Vector3d(10 + 2 * x, 20, 30 + 2 * y), 1e-4))
      return mesh.uvs[i].cast<double>();
  ADD_FAILURE() << "no corner at " << x << ", " << y;
  return {};
}

// v counts down in glTF and up in Mesh: (0, 0), (1, 0), (0, 1) of the file become (0, 1), (1, 1), (0, 0).
TEST(Mesh, ATextureTransformMovesTheUvs) {
  written("moved/paint.png", small_png());
  const auto loaded = [&](const std::string& how) {
    testing::internal::CaptureStderr();
    auto mesh = load_mesh(written("moved/part.gltf", placed_gltf(moved(how))), LengthUnit::metre);
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << how;
    EXPECT_TRUE(mesh) << mesh.message();
    return std::move(mesh).value();
  };
  const auto expect_uvs = [&](const std::string& how, Vector2d origin, Vector2d along_u, Vector2d along_v) {
    const Mesh mesh = loaded(how);
    const auto in_file = [&](double x, double y) {
      const Vector2d uv = uv_at(mesh, x, y);
      return Vector2d(uv.x(), 1 - uv.y());
    };
    EXPECT_TRUE(test::near(in_file(0, 0), origin, 1e-5)) << how;
    EXPECT_TRUE(test::near(in_file(1, 0), along_u, 1e-5)) << how;
    EXPECT_TRUE(test::near(in_file(0, 1), along_v, 1e-5)) << how;
  };
  expect_uvs("", {0, 0}, {1, 0}, {0, 1});
  expect_uvs(R"("offset":[0.25,0.5])", {0.25, 0.5}, {1.25, 0.5}, {0.25, 1.5});
  expect_uvs(R"("scale":[2,3])", {0, 0}, {2, 0}, {0, 3});
  // A rotation by 90 degrees, counter-clockwise in the image.
  expect_uvs(R"("rotation":1.5707963)", {0, 0}, {0, -1}, {1, 0});
  expect_uvs(R"("offset":[0.25,0.5],"rotation":1.5707963,"scale":[2,3])", {0.25, 0.5}, {0.25, -1.5},
             {3.25, 0.5});
}

TEST(Mesh, TexturesLieInTheCoordinatesThatTheMaterialNames) {
  written("second/paint.png", small_png());
  testing::internal::CaptureStderr();
  const auto mesh = load_mesh(written("second/part.gltf", placed_gltf(R"("texCoord":1)")), LengthUnit::metre);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  ASSERT_TRUE(mesh) << mesh.message();
  EXPECT_TRUE(test::near(uv_at(*mesh, 0, 0), Vector2d(0, 1), 1e-6));
  EXPECT_TRUE(test::near(uv_at(*mesh, 1, 0), Vector2d(0, 0), 1e-6));
  EXPECT_TRUE(test::near(uv_at(*mesh, 0, 1), Vector2d(0, 1), 1e-6));
}

TEST(Mesh, TexturesOfAMaterialMayLieInTwoPlaces) {
  written("apart/paint.png", small_png());
  std::string messages;
  const auto loaded = [&](const std::string& base, const std::string& maps) {
    testing::internal::CaptureStderr();
    auto mesh = load_mesh(written("apart/part.gltf", placed_gltf(base, R"("name":"chrome",)" + maps)),
                          LengthUnit::metre);
    messages = testing::internal::GetCapturedStderr();
    EXPECT_TRUE(mesh) << mesh.message();
    return mesh ? *mesh : Mesh{};
  };
  const auto normals = [](const std::string& place) {
    return R"("normalTexture":{"index":1,)" + place + "},";
  };
  const std::string twice = moved(R"("scale":[2,2])");
  for (const std::string& place : {twice, std::string(R"("texCoord":1)")}) {
    const Mesh mesh = loaded(place, normals(place));
    EXPECT_EQ(messages, "");
    EXPECT_TRUE(mesh.second_uvs.empty());
    EXPECT_FALSE(mesh.materials[mesh.triangle_materials[0]].maps.normals.in_second_uvs);
  }
  Mesh mesh = loaded(twice, normals(R"("texCoord":0)"));
  EXPECT_EQ(messages, "");
  ASSERT_EQ(mesh.second_uvs.size(), mesh.uvs.size());
  EXPECT_TRUE(mesh.materials[mesh.triangle_materials[0]].maps.normals.in_second_uvs);
  for (std::size_t i = 0; i < mesh.uvs.size(); ++i)  // v counts up
    EXPECT_TRUE(test::near((mesh.uvs[i] - Eigen::Vector2f(0, 1)).cast<double>(),
                           2 * (mesh.second_uvs[i] - Eigen::Vector2f(0, 1)).cast<double>(), 1e-5));
  mesh = loaded(R"("texCoord":0)", normals(R"("texCoord":1)"));
  EXPECT_EQ(messages, "");
  mesh.uvs = mesh.second_uvs;
  EXPECT_TRUE(test::near(uv_at(mesh, 1, 0), Vector2d(0, 0), 1e-6));
  // The third is told.
  loaded(twice, normals(R"("texCoord":1)") + R"("occlusionTexture":{"index":1,"texCoord":0},)");
  for (const char* word : {"apart/part.gltf", "'chrome'", "occlusion texture", "third", "coordinates 0"})
    EXPECT_NE(messages.find(word), std::string::npos) << word << " in: " << messages;
}

// placed_gltf with a normal map of the same mapping, and with normals and tangents in the file.
std::string gltf_with_tangents(const std::string& place, const Vector3f& tangent) {
  std::string text = placed_gltf(place, R"("normalTexture":{"index":1,)" + place + "},");
  std::vector<float> data;
  for (int i = 0; i < 3; ++i) data.insert(data.end(), {0, 0, 1});
  for (int i = 0; i < 3; ++i) data.insert(data.end(), {tangent.x(), tangent.y(), tangent.z(), 1});
  const std::string buffer(reinterpret_cast<const char*>(data.data()), data.size() * sizeof(float));
  const auto add = [&](const std::string& before, const std::string& more) {
    text.insert(text.find(before) + before.size(), more);
  };
  add(R"("TEXCOORD_0":1,)", R"("NORMAL":3,"TANGENT":4,)");
  add(R"("count":3,"type":"VEC2"},{"bufferView":0,"componentType":5126,"count":3,"type":"VEC2"})",
      R"(,{"bufferView":2,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":3,"componentType":5126,"count":3,"type":"VEC4"})");
  add(R"("byteOffset":36,"byteLength":24})",
      R"(,{"buffer":1,"byteLength":36},{"buffer":1,"byteOffset":36,"byteLength":48})");
  text.insert(text.rfind("]}"),
              R"(,{"byteLength":84,"uri":"data:application/octet-stream;base64,)" + base64(buffer) + R"("})");
  return text;
}

// The directions in a normal map rotate together with the image.
TEST(Mesh, TangentsOfTheFileGoWhereATransformTurnsTheTexture) {
  written("turned/paint.png", small_png());
  const auto tangent = [&](const std::string& how) {
    const auto mesh = load_mesh(written("turned/part.gltf", gltf_with_tangents(moved(how), {0.6f, 0.8f, 0})),
                                LengthUnit::metre);
    EXPECT_TRUE(mesh) << mesh.message();
    return Vector3d(mesh->tangents.at(0).head<3>().cast<double>());
  };
  EXPECT_TRUE(test::near(tangent(R"("offset":[0.5,0],"scale":[2,3])"), Vector3d(0.6, 0, 0.8), 1e-5));
  EXPECT_TRUE(test::near(tangent(R"("rotation":1.5707963)"), Vector3d(0, 0, 1), 1e-5));
  EXPECT_TRUE(test::near(tangent(R"("scale":[-1,1])"), Vector3d(-1, 0, 0), 1e-5));
}

// Two adjacent squares that share two corners; the uvs of the right one are mirrored.
Mesh mirrored_squares() {
  Mesh mesh;
  for (const float y : {0.f, 1.f})
    for (const float x : {-1.f, 0.f, 1.f}) {
      mesh.positions.push_back({0.2f * x, 0.1f * y, 0.3f * x});
      mesh.normals.push_back(Vector3f(-3, 0, 2).normalized());
      mesh.uvs.push_back({1 - std::abs(x), y});
    }
  mesh.triangles = {{0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}};
  mesh.triangle_materials.assign(4, 0);
  return mesh;
}

void expect_tangents_along_uvs(const Mesh& mesh) {
  ASSERT_EQ(mesh.tangents.size(), mesh.positions.size());
  for (const auto& triangle : mesh.triangles) {
    const Vector3f p = mesh.positions[triangle[0]];
    for (const std::uint32_t corner : triangle) {
      const Eigen::Vector4f& tangent = mesh.tangents[corner];
      const Vector3f t = tangent.head<3>(), b = tangent.w() * mesh.normals[corner].cross(t);
      EXPECT_NEAR(t.norm(), 1, 1e-5);
      EXPECT_NEAR(t.dot(mesh.normals[corner]), 0, 1e-5);
      for (const std::uint32_t other :
           triangle) {  // in a plane, uvs change only along the tangent and the bitangent
        const Vector3f step = mesh.positions[other] - p;
        const Eigen::Vector2f uv = mesh.uvs[other] - mesh.uvs[triangle[0]];
        EXPECT_NEAR(step.dot(t), uv.x() * std::hypot(0.2f, 0.3f), 1e-5);
        EXPECT_NEAR(step.dot(b), uv.y() * 0.1f, 1e-5);
      }
    }
  }
}

TEST(Mesh, TangentsFollowTheUvsAlsoWhereTheseAreMirrored) {
  Mesh mesh = mirrored_squares();
  add_tangents(&mesh);
  EXPECT_EQ(mesh.positions.size(), 8u);  // the two shared corners have two vertices each
  expect_tangents_along_uvs(mesh);
}

TEST(Mesh, TangentsOfTheFileAreKept) {
  Mesh mesh = mirrored_squares();
  std::vector<Eigen::Vector4f> own(12, Eigen::Vector4f(0, 1, 0, -1));
  own[4].setZero();  // a tangent that is missing in the file
  add_tangents(&mesh, own);
  int kept = 0, made = 0;
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t corner : triangle) {
      kept += mesh.tangents[corner] == own[0];
      made += std::abs(mesh.tangents[corner].y()) < 1e-5f;
    }
  EXPECT_EQ(kept, 11);
  EXPECT_EQ(made, 1);
}

TEST(Mesh, ObjAndPlyLoadWithNormalsMade) {
  const auto obj =
      load_mesh(written("quad.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\n"), LengthUnit::inch);
  ASSERT_TRUE(obj) << obj.message();
  EXPECT_EQ(obj->triangles.size(), 2u);
  EXPECT_EQ(obj->positions.size(), 4u);
  EXPECT_NEAR(obj->positions[2].x(), 0.0508, 1e-6);
  EXPECT_NEAR(obj->normals[0].z(), 1, 1e-6);
  EXPECT_FALSE(obj->materials.empty());
  const auto ply = load_mesh(written("quad.ply", k_quad_ply), LengthUnit::metre);
  ASSERT_TRUE(ply) << ply.message();
  EXPECT_EQ(ply->positions.size(), 4u);
  EXPECT_NEAR(ply->normals[3].z(), 1, 1e-6);
}

// Two triangles with three vertices; the last index of the second one is `last`.
std::string indexed_gltf(std::uint16_t last) {
  const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::uint16_t indices[] = {0, 1, 2, 2, 1, last};
  const std::string buffer = std::string(reinterpret_cast<const char*>(corners), sizeof(corners)) +
                             std::string(reinterpret_cast<const char*>(indices), sizeof(indices));
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":12}],
"buffers":[{"byteLength":48,"uri":"data:application/octet-stream;base64,)" +
         base64(buffer) + R"("}]})";
}

TEST(Mesh, AnIndexBeyondTheVerticesIsAnErrorAndNoMissingTriangle) {
  ASSERT_TRUE(load_mesh(written("whole.gltf", indexed_gltf(0)), LengthUnit::metre));
  const auto mesh = load_mesh(written("beyond.gltf", indexed_gltf(9)), LengthUnit::metre);
  ASSERT_FALSE(mesh);
  EXPECT_NE(mesh.message().find("beyond.gltf"), std::string::npos) << mesh.message();
  EXPECT_NE(mesh.message().find("indices"), std::string::npos) << mesh.message();
}

TEST(Mesh, BadFilesAreErrorsThatNameThem) {
  auto triangles = cube();
  const std::string whole = binary_stl(triangles);
  triangles[3][1].y() = std::numeric_limits<float>::quiet_NaN();
  const std::string ply = k_quad_ply;
  const struct {
    const char* name;
    std::string content;
    const char* says;
  } cases[] = {
      {"truncated.stl", whole.substr(0, whole.size() / 2), "truncated.stl"},
      {"truncated.ply", ply.substr(0, ply.find("1 1 0")), "truncated.ply"},
      {"truncated.glb", std::string("glTF\2\0\0\0\xff\0\0\0", 12), "truncated.glb"},
      {"garbage.gltf", "not json", "garbage.gltf"},
      {"empty.obj", "", "empty.obj"},
      {"points.obj", "v 0 0 0\nv 1 0 0\n", "triangles"},
      {"lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n", "triangles"},
      {"flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "triangles"},
      {"nan.stl", binary_stl(triangles), "finite"},
      {"part.blend", "BLENDER", "glb"},
  };
  for (const auto& bad : cases) {
    const auto mesh = load_mesh(written(bad.name, bad.content), LengthUnit::metre);
    ASSERT_FALSE(mesh) << bad.name;
    EXPECT_NE(mesh.message().find(bad.says), std::string::npos) << mesh.message();
    EXPECT_NE(mesh.message().find(bad.name), std::string::npos) << mesh.message();
  }
  EXPECT_FALSE(load_mesh("nowhere.stl", LengthUnit::metre));
}

TEST(Mesh, DamagedPlyFilesAreErrorsWithinASecond) {
  const fs::path folder = test::test_folder();
  const std::string vertices =
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\n";
  const std::string points = "0 0 0\n1 0 0\n0 1 0\n";
  const std::map<std::string, std::string> files = {
      {"cut-header.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"},
      {"no-corners.ply", "ply\nformat ascii 1.0\n" + vertices + "end_header\n" + points + "0\n"},
      {"too-many.ply", "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n0\n"},
      {"junk.ply", "ply\nformat ascii 1.0\neleme" + std::string(100, '\x1f')},
      {"cut.ply", "ply\nformat ascii 1.0\n" + vertices + "end_header\n0 0 0\n1 0"},
      {"line-feed.ply",
       "ply\nformat binary_little_endian 1.0\n" + vertices + "end_header\n\n" + std::string(20, '\0')}};
  for (const auto& [name, content] : files) {
    ASSERT_TRUE(write_file(folder / name, content));
    const auto begun = std::chrono::steady_clock::now();
    const auto mesh = load_mesh(folder / name, LengthUnit::metre);
    ASSERT_FALSE(mesh) << name;
    EXPECT_NE(mesh.message().find(name), std::string::npos) << mesh.message();
    EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(3))
        << name << ": a second is asked for";
  }
}

TEST(Nearest, AgreesWithASearchOverSamplesOfACube) {
  const auto mesh = load_mesh(written("nearest.stl", binary_stl(cube())), LengthUnit::metre);
  ASSERT_TRUE(mesh) << mesh.message();
  auto rng = test::test_rng();
  std::uniform_real_distribution<double> u(-3, 3);
  for (int i = 0; i < 500; ++i) {
    const Vector3d p(u(rng), u(rng), u(rng));
    const MeshPoint found = nearest_on(*mesh, p);
    Vector3d expected = p.cwiseMax(-1).cwiseMin(1);
    if (expected == p) {  // a point inside the cube goes to the nearest side
      int axis = 0;
      p.cwiseAbs().maxCoeff(&axis);
      expected[axis] = p[axis] > 0 ? 1 : -1;
    }
    EXPECT_TRUE(test::near(found.p, expected, 1e-5));
    EXPECT_NEAR(found.distance, (expected - p).norm(), 1e-5);
    EXPECT_NEAR(found.d_normal.dot(found.p), 1, 1e-5);  // normals of the cube's sides
  }
}

// Two meshes with poses are read back as one mesh with the poses applied and with materials and textures.
TEST(Glb, PutsMeshesInTheirPlaces) {
  Mesh plain;
  plain.positions = {{0, 0, 0}, {0.1f, 0, 0}, {0, 0.1f, 0}};
  plain.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
  plain.triangles = {{0, 1, 2}};
  plain.triangle_materials = {0};
  plain.materials.resize(1);
  plain.materials[0].base_colour = {0.5f, 0.25f, 1};
  plain.materials[0].unlit = true;
  plain.materials[0].metallic = 0.5f;
  plain.materials[0].roughness = 0.25f;
  Mesh textured = plain;
  textured.uvs = {{0, 0}, {1, 0}, {0, 0.25f}};
  textured.materials = {{.texture = cv::Mat(4, 4, CV_8UC3, cv::Scalar(10, 200, 30))},
                        {.texture = cv::Mat(4, 4, CV_8UC4, cv::Scalar(10, 20, 30, 255)), .cut_below = 0.25f}};
  textured.triangles.push_back({0, 2, 1});
  textured.triangle_materials = {0, 1};
  const Pose lifted(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized())), {1, -2, 0.5});
  const std::vector<GlbNode> placed = {
      {"plain", &plain, {}}, {"lifted", &textured, lifted}, {"again", &plain, lifted}};
  const std::string bytes = encode_glb(placed);
  EXPECT_EQ(bytes, encode_glb(placed));
  EXPECT_LT(bytes.size(),
            encode_glb(std::vector{placed[0], placed[1]}).size() + 300);  // a mesh is written only once

  const auto loaded = load_mesh(written("placed.glb", bytes), LengthUnit::metre);
  ASSERT_TRUE(loaded) << loaded.message();
  ASSERT_EQ(loaded->triangles.size(), 4U);
  const auto has = [&](const Vector3d& p) {
    return std::any_of(loaded->positions.begin(), loaded->positions.end(),
                       [&](const Vector3f& q) { return (q.cast<double>() - p).norm() < 1e-6; });
  };
  for (const Vector3f& p : plain.positions) {
    EXPECT_TRUE(has(p.cast<double>()));
    EXPECT_TRUE(has(lifted * p.cast<double>().eval()));
  }
  int textures = 0, unlit = 0, cut = 0;
  for (const Material& material : loaded->materials) {
    cut += material.cut_below == 0.25f && material.texture.at<cv::Vec4b>(1, 1) == cv::Vec4b(10, 20, 30, 255);
    if (material.cut_below > 0) continue;
    textures += !material.texture.empty() && material.texture.at<cv::Vec3b>(1, 1) == cv::Vec3b(10, 200, 30);
    unlit += material.unlit && (material.base_colour - plain.materials[0].base_colour).norm() < 1e-6 &&
             material.metallic == 0.5f && material.roughness == 0.25f;
  }
  EXPECT_GE(textures, 1);
  EXPECT_GE(unlit, 1);
  EXPECT_GE(cut, 1);
}

TEST(Glb, MapsOfASurfaceComeBack) {
  Mesh mesh = mirrored_squares();
  add_tangents(&mesh);
  const cv::Mat packed(4, 4, CV_8UC3, cv::Scalar(51, 102, 153));
  mesh.materials[0] = {.texture = cv::Mat(4, 4, CV_8UC3, cv::Scalar(10, 200, 30)),
                       .emitted = {0.5f, 1, 0.25f},
                       .maps = {.metallic_roughness = {packed, ""},
                                .normals = {cv::Mat(4, 4, CV_8UC3, cv::Scalar(200, 140, 90)), ""},
                                .occlusion = {packed, ""},
                                .emission = {cv::Mat(4, 4, CV_8UC3, cv::Scalar(1, 2, 3)), ""},
                                .normal_scale = 0.5f,
                                .occlusion_strength = 0.75f}};
  const Pose lifted(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized())), {1, -2, 0.5});
  const std::vector<GlbNode> placed = {{"part", &mesh, lifted}};
  const auto loaded = load_mesh(written("maps.glb", encode_glb(placed)), LengthUnit::metre);
  ASSERT_TRUE(loaded) << loaded.message();
  const Material& material = loaded->materials[loaded->triangle_materials[0]];
  EXPECT_EQ(material.maps.metallic_roughness.image.at<cv::Vec3b>(3, 3), cv::Vec3b(51, 102, 153));
  EXPECT_EQ(material.maps.occlusion.image.data, material.maps.metallic_roughness.image.data);
  EXPECT_EQ(material.maps.normals.image.at<cv::Vec3b>(3, 3), cv::Vec3b(200, 140, 90));
  EXPECT_EQ(material.maps.emission.image.at<cv::Vec3b>(3, 3), cv::Vec3b(1, 2, 3));
  EXPECT_EQ(material.maps.normal_scale, 0.5f);
  EXPECT_EQ(material.maps.occlusion_strength, 0.75f);
  EXPECT_TRUE(test::near(material.emitted.cast<double>(), Vector3d(0.5, 1, 0.25), 1e-6));
  expect_tangents_along_uvs(*loaded);
}

}  // namespace
}  // namespace limn::scene
