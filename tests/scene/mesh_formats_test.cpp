#include <unistd.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/file.h"
#include "exchange/zip.h"
#include "scene/meshes/mesh.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
namespace fs = std::filesystem;

fs::path written(const std::string& name, const std::string& content) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  const fs::path path =
      fs::temp_directory_path() / ("limn-formats-" + std::to_string(getpid())) / test->name() / name;
  fs::create_directories(path.parent_path());
  EXPECT_TRUE(write_file(path, content));
  return path;
}

std::string png(const cv::Scalar& bgr) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", cv::Mat(2, 2, CV_8UC3, bgr), bytes);
  return {bytes.begin(), bytes.end()};
}

struct Loaded {
  Mesh mesh;
  std::string messages;
};

// The mesh with the messages of its loading; a failure of the test when it cannot be read.
Loaded loaded(const fs::path& path, std::optional<LengthUnit> units = LengthUnit::millimetre) {
  testing::internal::CaptureStderr();
  auto mesh = load_mesh(path, units);
  Loaded out{mesh ? *mesh : Mesh{}, testing::internal::GetCapturedStderr()};
  EXPECT_TRUE(mesh) << mesh.message();
  return out;
}

std::string error_of(const fs::path& path, std::optional<LengthUnit> units = LengthUnit::millimetre) {
  const auto mesh = load_mesh(path, units);
  return mesh ? "(no error)" : mesh.message();
}

testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << part << "' is not in: " << text;
}

Vector3d sides_mm(const Mesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Vector3f& p : mesh.positions) box.extend(p);
  return 1e3 * Vector3f(box.sizes()).cast<double>();
}

// The mesh's colour at the vertex nearest to a place (mm), times its material's base colour.
Vector3d colour_at(const Mesh& mesh, const Vector3d& p_mm) {
  double nearest = 1e9;
  Vector3d colour = Vector3d::Constant(-1);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t i : mesh.triangles[t]) {
      const double distance = (1e3 * mesh.positions[i].cast<double>() - p_mm).norm();
      if (distance >= nearest) continue;
      nearest = distance;
      colour = mesh.materials[mesh.triangle_materials[t]].base_colour.cast<double>();
      if (!mesh.colours.empty()) colour = colour.cwiseProduct(mesh.colours[i].cast<double>());
    }
  return colour;
}

const Material& material_of(const Mesh& mesh) { return mesh.materials.at(mesh.triangle_materials.at(0)); }

constexpr double k_half_srgb = 0.21586;  // linear light of the sRGB level 0.50196 (128 of 255)

// ---- OBJ ----

const char* k_plate = "v 0 0 0\nv 100 0 0\nv 100 80 0\nv 0 80 0\n";

TEST(ObjMesh, OddNumbersBlanksAndLineEndsAreRead) {
  const Loaded plate = loaded(written(
      "odd.obj",
      "\xef\xbb\xbf# a comment\r\n\r\nv\t.0 -.0 +0.\t \r\nv 1e2 0 0 # to the right\r\nv 100. +80 -0\r\n"
      "v 0 \\\r\n  80 0\r\n  vt 0 0\r\nvt 1 0 0\r\nvt 1. 1\r\nvt .0 1\r\nvn 0 0 1\r\n\tf   -4/-4/-1 -3/-3/-1 "
      "\\\r\n -2/-2/-1 "
      "-1/-1/-1   \r\n"));
  EXPECT_TRUE(test::near(sides_mm(plate.mesh), Vector3d(100, 80, 0), 1e-4));
  EXPECT_EQ(plate.mesh.triangles.size(), 2U);
  EXPECT_EQ(plate.mesh.uvs.size(), 4U);
  EXPECT_EQ(plate.messages, "");
  const Loaded weighted = loaded(written("w.obj", "v 0 0 0 1\nv 200 0 0 2\nv 50 40 0 .5\nf 1//  2// 3//\n"));
  EXPECT_TRUE(test::near(sides_mm(weighted.mesh), Vector3d(100, 80, 0), 1e-4));
}

TEST(ObjMesh, WhatCannotBeReadIsNamedWithItsLine) {
  EXPECT_TRUE(contains(error_of(written("a.obj", std::string(k_plate) + "f 1 2 5\n")),
                       "a.obj: line 5: expected indices of the file's 4 vertices, found 5"));
  EXPECT_TRUE(contains(error_of(written("b.obj", std::string(k_plate) + "f 0 1 2\n")), "b.obj: line 5"));
  EXPECT_TRUE(
      contains(error_of(written("c.obj", "v 0 0 0\nv 1,5 0 0\n")), "c.obj: line 2: expected numbers"));
  EXPECT_TRUE(contains(error_of(written("d.obj", "v 0 0\n")), "d.obj: line 1: expected 3 numbers or more"));
}

TEST(ObjMesh, FacesMayComeFirstOrNameNormalsThatAreNotThere) {
  const Loaded plate = loaded(written("first.obj", std::string("f 1//1 2//2 3//3 4//4\n") + k_plate));
  EXPECT_TRUE(test::near(sides_mm(plate.mesh), Vector3d(100, 80, 0), 1e-4));
  EXPECT_TRUE(contains(plate.messages, "name texture coordinates or normals that it does not hold"));
  EXPECT_NEAR(plate.mesh.normals.at(0).z(), 1, 1e-6);
}

TEST(ObjMesh, NormalsOfAnyLengthBecomeUnitNormals) {
  const Loaded plate = loaded(
      written("long.obj", std::string(k_plate) + "vn 0 3 4\nvn 0 3e30 4e30\nvn 0 .6 .8\nf 1//1 2//2 3//3\n"));
  ASSERT_EQ(plate.mesh.normals.size(), 3U);
  for (const Vector3f& normal : plate.mesh.normals)
    EXPECT_TRUE(test::near(normal.cast<double>(), Vector3d(0, 0.6, 0.8), 1e-6));
}

TEST(ObjMesh, AColourThatIsNoFiniteNumberIsAnError) {
  for (const char* value : {"nan", "1e300"}) {
    written("bright.mtl", std::string("newmtl bright\nKd 0.5 0.5 ") + value + "\n");
    const std::string message = error_of(
        written("bright.obj", std::string("mtllib bright.mtl\n") + k_plate + "usemtl bright\nf 1 2 3\n"));
    EXPECT_TRUE(contains(message, "bright.obj: material 'bright': expected finite numbers"));
  }
}

TEST(ObjMesh, AConcavePolygonIsCutAlongItsInside) {
  const Loaded l = loaded(
      written("l.obj", "v 0 0 0\nv 100 0 0\nv 100 30 0\nv 30 30 0\nv 30 80 0\nv 0 80 0\nf 1 2 3 4 5 6\n"));
  double area = 0;
  for (const auto& t : l.mesh.triangles) {
    const Vector3f& a = l.mesh.positions[t[0]];
    const Vector3f n = (l.mesh.positions[t[1]] - a).cross(l.mesh.positions[t[2]] - a);
    EXPECT_GT(n.z(), 0);
    area += 0.5e6 * static_cast<double>(n.norm());
  }
  EXPECT_NEAR(area, 100 * 30 + 30 * 50, 0.01);
}

TEST(ObjMesh, ColoursOfVerticesAreTakenAsSrgb) {
  const std::string face = "f 1 2 3\n";
  const Loaded shares =
      loaded(written("shares.obj", "v 0 0 0 1 0 0\nv 100 0 0 0 0.50196 0\nv 0 80 0 0 0 1\n" + face));
  EXPECT_TRUE(test::near(colour_at(shares.mesh, {0, 0, 0}), Vector3d(1, 0, 0), 1e-4));
  EXPECT_TRUE(test::near(colour_at(shares.mesh, {100, 0, 0}), Vector3d(0, k_half_srgb, 0), 1e-4));
  const Loaded levels =
      loaded(written("levels.obj", "v 0 0 0 255 0 0\nv 100 0 0 0 128 0\nv 0 80 0 0 0 255\n" + face));
  EXPECT_TRUE(test::near(colour_at(levels.mesh, {100, 0, 0}), Vector3d(0, k_half_srgb, 0), 1e-4));
  EXPECT_TRUE(test::near(colour_at(loaded(written("none.obj", std::string(k_plate) + face)).mesh, {0, 0, 0}),
                         Vector3d::Constant(0.6), 1e-6));
}

TEST(ObjMesh, MaterialsAndTexturesInAnotherFolderAreFound) {
  const std::string text = std::string("mtllib materials\\My Part.mtl  \n") + k_plate +
                           "vt 0 0\nusemtl old  wood \nf 1/1 2/1 3/1\n";
  const fs::path obj = written("part.obj", text);
  written("materials/My Part.mtl",
          "newmtl old  wood\r\n\tKd .5 0.5 +1\r\n  map_Kd -clamp on -s 2 3 1 -o 0.25 0 -bm 0.5 wood "
          "grain.png \r\n");
  written("materials/wood grain.png", png({10, 20, 30}));
  const Loaded part = loaded(obj);
  EXPECT_EQ(material_of(part.mesh).texture.at<cv::Vec3b>(0, 0), cv::Vec3b(10, 20, 30));
  EXPECT_TRUE(test::near(material_of(part.mesh).base_colour.cast<double>(), Vector3d(0.5, 0.5, 1), 1e-6));
  EXPECT_TRUE(test::near(part.mesh.uvs.at(0).cast<double>(), Eigen::Vector2d(0.25, 0), 1e-6));
  EXPECT_EQ(part.messages, "");
}

TEST(ObjMesh, AMissingMtlOrMaterialIsAWarning) {
  const std::string faces = std::string(k_plate) + "usemtl wood\nf 1 2 3\n";
  const Loaded without = loaded(written("a/part.obj", "mtllib gone.mtl\n" + faces));
  EXPECT_TRUE(contains(without.messages, "expected the material file gone.mtl"));
  written("b/some.mtl", "newmtl steel\nKd 1 0 0\n");
  EXPECT_TRUE(contains(loaded(written("b/part.obj", "mtllib some.mtl\n" + faces)).messages,
                       "expected the materials 'wood'"));
  written("d/my part.mtl", "newmtl wood\nKd 1 0 0\n");
  const Loaded two = loaded(written("d/part.obj", "mtllib gone.mtl my\\ part.mtl\n" + faces));
  EXPECT_TRUE(contains(two.messages, "expected the material files gone.mtl, found none"));
  EXPECT_TRUE(test::near(colour_at(two.mesh, {0, 0, 0}), Vector3d(1, 0, 0), 1e-6));
  written("c/part.mtl", "newmtl wood\nKd 1 0 0\n");  // the file's name was changed together with the mesh's
  const Loaded renamed = loaded(written("c/part.obj", "mtllib before.mtl\n" + faces));
  EXPECT_TRUE(contains(renamed.messages, "part.mtl is used"));
  EXPECT_TRUE(test::near(colour_at(renamed.mesh, {0, 0, 0}), Vector3d(1, 0, 0), 1e-6));
}

TEST(ObjMesh, ATextureInOtherCaseIsFoundWithANote) {
  written("part.mtl", "newmtl wood\nKd 0 0 0\nmap_Kd Textures/Wood.PNG\n");
  written("textures/wood.png", png({10, 20, 30}));
  const Loaded part = loaded(written(
      "part.obj", std::string("mtllib part.mtl\nvt 0 0\n") + k_plate + "usemtl wood\nf 1/1 2/1 3/1\n"));
  EXPECT_EQ(material_of(part.mesh).texture.cols, 2);
  EXPECT_TRUE(contains(part.messages, "names the texture Textures/Wood.PNG"));
  EXPECT_EQ(material_of(part.mesh).base_colour,
            Vector3f::Ones());  // black beside a texture means the texture
}

// ---- STL ----

std::string facet(const std::string& word, const std::string& corners) {
  return word + " normal 0 0 1\n outer loop\n" + corners + " endloop\nendfacet\n";
}

const char* k_first = "  vertex 0 0 0\n  vertex 1e2 0 0\n  vertex 100 .8e2 0\n";
const char* k_second = "  vertex 0 0 0\n  vertex 100 80 0\n  vertex 0 80 0\n";

TEST(StlMesh, AsciiIsReadInCapitalsWithBlanksAndJunk) {
  const std::string facets = facet("facet", k_first) + facet("facet", k_second);
  std::string capitals = "solid my facet part\n" + facets + "endsolid my part\n";
  for (char& c : capitals) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  for (const std::string& text : {capitals, "\n  \r\n  Solid\n" + facets + "EndSolid",
                                  "solid a\n" + facets + "endsolid a\n\x1a" + std::string(7, '\0'),
                                  "solid a\r\n" + facet("facet", k_first) + "endsolid a\r\nsolid b\r\n" +
                                      facet("facet", k_second) + "endsolid b\r\n"}) {
    const Loaded plate = loaded(written("plate.stl", text));
    EXPECT_TRUE(test::near(sides_mm(plate.mesh), Vector3d(100, 80, 0), 1e-4)) << text;
    EXPECT_EQ(plate.mesh.triangles.size(), 2U) << text;
    EXPECT_EQ(plate.messages, "");
  }
}

TEST(StlMesh, AsciiThatIsCutIsAnErrorOrAWarning) {
  const std::string text = "solid a\n" + facet("facet", k_first) + facet("facet", k_second);
  EXPECT_TRUE(contains(error_of(written("cut.stl", text.substr(0, text.size() - 20))), "cut.stl"));
  EXPECT_TRUE(
      contains(error_of(written("number.stl", text.substr(0, text.rfind("80")))), "without three numbers"));
  EXPECT_TRUE(contains(loaded(written("whole.stl", text)).messages, "2 facets are shown"));
}

std::string binary_stl(const std::string& begin, const std::vector<std::uint16_t>& colours) {
  std::string bytes = begin + std::string(80 - begin.size(), '\0');
  const auto put = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof(value)); };
  put(static_cast<std::uint32_t>(colours.size()));
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const float x = 100.F * static_cast<float>(i);
    for (const float v : {0.F, 0.F, 1.F, x, 0.F, 0.F, x + 100, 0.F, 0.F, x, 80.F, 0.F}) put(v);
    put(colours[i]);
  }
  return bytes;
}

TEST(StlMesh, BinaryIsReadThoughItBeginsWithSolidOrHasJunkBehind) {
  const std::string bytes = binary_stl("solid facet by SolidWorks", {0, 0});
  for (const std::string& text : {bytes, bytes + "junk", bytes + std::string(50, '\0')})
    EXPECT_TRUE(test::near(sides_mm(loaded(written("binary.stl", text)).mesh), Vector3d(200, 80, 0), 1e-4));
  EXPECT_TRUE(contains(error_of(written("cut.stl", bytes.substr(0, bytes.size() - 1))), "hold 2 facets"));
  std::string uncounted = bytes;
  uncounted.replace(80, 4, 4, '\0');
  EXPECT_EQ(loaded(written("uncounted.stl", uncounted)).mesh.triangles.size(), 2U);
}

// VisCAM: bit 15 says that the colour is valid, blue is lowest. Materialise: the reverse in both.
TEST(StlMesh, ColoursOfFacetsAreRead) {
  const std::uint16_t red_high = 31 << 10, red_low = 31;
  const Mesh viscam =
      loaded(written("viscam.stl", binary_stl("", {static_cast<std::uint16_t>(0x8000 | red_high), 0}))).mesh;
  EXPECT_TRUE(test::near(colour_at(viscam, {10, 70, 0}), Vector3d(1, 0, 0), 1e-4));
  EXPECT_TRUE(test::near(colour_at(viscam, {200, 0, 0}), Vector3d::Constant(0.6), 1e-4));
  const std::string header = std::string("COLOR=") + "\x80" + std::string(2, '\0') + "\xff,MATERIAL=";
  const Mesh magics = loaded(written("magics.stl", binary_stl(header, {red_low, 0x8000}))).mesh;
  EXPECT_TRUE(test::near(colour_at(magics, {10, 70, 0}), Vector3d(1, 0, 0), 1e-4));
  EXPECT_TRUE(test::near(colour_at(magics, {200, 0, 0}), Vector3d(k_half_srgb, 0, 0), 1e-4));
  EXPECT_TRUE(loaded(written("plain.stl", binary_stl("", {0, 0}))).mesh.colours.empty());
}

// ---- PLY ----

std::string ply(const std::string& vertex,
                const std::string& face,
                const std::string& data,
                int faces = 2,
                const std::string& comments = "") {
  return "ply\nformat ascii 1.0\n" + comments +
         "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n" + vertex +
         "element face " + std::to_string(faces) + "\nproperty list uchar int vertex_indices\n" + face +
         "end_header\n" + data;
}

TEST(PlyMesh, ColoursOfVerticesAreTakenAsSrgb) {
  const std::string levels = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  const Mesh of_levels = loaded(written("levels.ply", ply(levels, "",
                                                          "0 0 0 255 0 0\n100 0 0 0 128 0\n100 80 0 0 0 "
                                                          "255\n0 80 0 255 255 255\n3 0 1 2\n3 0 2 3\n")))
                             .mesh;
  EXPECT_EQ(of_levels.positions.size(), 4U);
  EXPECT_TRUE(test::near(colour_at(of_levels, {0, 0, 0}), Vector3d(1, 0, 0), 1e-4));
  EXPECT_TRUE(test::near(colour_at(of_levels, {100, 0, 0}), Vector3d(0, k_half_srgb, 0), 1e-4));
  const std::string shares =
      "property float diffuse_red\nproperty float diffuse_green\nproperty float diffuse_blue\n";
  const Mesh of_shares =
      loaded(
          written("shares.ply",
                  ply(shares, "",
                      "0 0 0 1 0 0\n100 0 0 0 .50196 0\n100 80 0 0 0 1\n0 80 0 1 1 1\n3 0 1 2\n3 0 2 3\n")))
          .mesh;
  EXPECT_TRUE(test::near(colour_at(of_shares, {100, 0, 0}), Vector3d(0, k_half_srgb, 0), 1e-4));
}

TEST(PlyMesh, ColoursAndTextureCoordinatesOfFacesAreRead) {
  const std::string places = "0 0 0\n100 0 0\n100 80 0\n0 80 0\n";
  const Mesh coloured =
      loaded(written("faces.ply", ply("", "property uchar red\nproperty uchar green\nproperty uchar blue\n",
                                      places + "3 0 1 2 255 0 0\n3 0 2 3 0 128 0\n")))
          .mesh;
  EXPECT_TRUE(test::near(colour_at(coloured, {100, 0, 0}), Vector3d(1, 0, 0), 1e-4));
  EXPECT_TRUE(test::near(colour_at(coloured, {0, 80, 0}), Vector3d(0, k_half_srgb, 0), 1e-4));
  written("red.png", png({0, 0, 255}));
  written("green.png", png({0, 255, 0}));
  const Loaded textured =
      loaded(written("uv.ply", ply("", "property list uchar float texcoord\nproperty int texnumber\n",
                                   places + "3 0 1 2 6 0 0 1 0 1 1 0\n3 0 2 3 6 0 0 1 1 0 .5 1\n", 2,
                                   "comment TextureFile red.png \ncomment TextureFile green.png\n")));
  ASSERT_EQ(textured.mesh.triangle_materials, (std::vector<std::uint16_t>{0, 1}));
  EXPECT_EQ(textured.mesh.materials[1].texture.at<cv::Vec3b>(0, 0), cv::Vec3b(0, 255, 0));
  EXPECT_TRUE(test::near(textured.mesh.uvs[textured.mesh.triangles[1][2]].cast<double>(),
                         Eigen::Vector2d(0, 0.5), 1e-6));
}

TEST(PlyMesh, AFaceOfNoCornersIsLeftOutWithAWarning) {
  const std::string places = "0 0 0\n100 0 0\n100 80 0\n0 80 0\n";
  const Loaded plate = loaded(written("plate.ply", ply("", "", places + "0\n4 0 1 2 3\n")));
  EXPECT_TRUE(test::near(sides_mm(plate.mesh), Vector3d(100, 80, 0), 1e-4));
  EXPECT_TRUE(contains(plate.messages, "1 of 2 faces have fewer than three corners"));
  EXPECT_TRUE(contains(error_of(written("beyond.ply", ply("", "", places + "3 0 1 4\n3 0 1 2\n"))),
                       "beyond.ply: expected faces with indices of its 4 vertices"));
}

TEST(PlyMesh, BigEndianAndStripsAndOldLineEndsAreRead) {
  std::string bytes =
      "ply\rformat binary_big_endian 1.0\relement vertex 4\rproperty float x\rproperty float y\rproperty "
      "float z\r"
      "element tristrips 1\rproperty list int int vertex_indices\rend_header\r";
  const auto put = [&](auto value) {
    const auto* raw = reinterpret_cast<const char*>(&value);
    for (std::size_t i = sizeof(value); i > 0; --i) bytes += raw[i - 1];
  };
  for (const float v : {0.F, 0.F, 0.F, 100.F, 0.F, 0.F, 0.F, 80.F, 0.F, 100.F, 80.F, 0.F}) put(v);
  for (const std::int32_t v : {5, 0, 1, 2, 3, -1}) put(v);
  const Mesh plate = loaded(written("strip.ply", bytes)).mesh;
  EXPECT_TRUE(test::near(sides_mm(plate), Vector3d(100, 80, 0), 1e-4));
  ASSERT_EQ(plate.triangles.size(), 2U);
  for (const Vector3f& n : plate.normals) EXPECT_NEAR(n.z(), 1, 1e-6);  // both triangles face the same side
}

// ---- formats that state their unit ----

const char* k_collada =
    R"(<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="inch" meter="0.0254"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="9">0 0 0 4 0 0 0 2 1</float_array>
<technique_common><accessor source="#pa" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><translate>1 0 0</translate><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>)";

const char* k_fbx = R"(; FBX 7.3.0 project file
FBXHeaderExtension:  {
	FBXHeaderVersion: 1003
	FBXVersion: 7300
}
GlobalSettings:  {
	Version: 1000
	Properties70:  {
		P: "UpAxis", "int", "Integer", "",2
		P: "UnitScaleFactor", "double", "Number", "",2.54
	}
}
Objects:  {
	Geometry: 1000, "Geometry::plate", "Mesh" {
		Vertices: *12 {
			a: 0,0,0,4,0,0,4,2,1,0,2,1
		}
		PolygonVertexIndex: *4 {
			a: 0,1,2,-4
		}
		GeometryVersion: 124
	}
	Model: 2000, "Model::plate", "Mesh" {
		Version: 232
		Properties70:  {
		}
	}
}
Connections:  {
	C: "OO",2000,0
	C: "OO",1000,2000
}
)";

TEST(StatedUnit, IsUsedAndNoAxisIsSwapped) {
  const Vector3d inches(4 * 25.4, 2 * 25.4, 25.4);
  EXPECT_TRUE(test::near(sides_mm(loaded(written("part.dae", k_collada), std::nullopt).mesh), inches, 1e-3));
  EXPECT_TRUE(test::near(sides_mm(loaded(written("part.fbx", k_fbx), std::nullopt).mesh), inches, 1e-3));
  const Loaded amf =
      loaded(written("part.amf",
                     R"(<?xml version="1.0"?><amf unit="inch" version="1.1"><object id="0"><mesh><vertices>
<vertex><coordinates><x>0</x><y>0</y><z>0</z></coordinates></vertex><vertex><coordinates><x>4</x><y>0</y><z>0</z></coordinates></vertex>
<vertex><coordinates><x>0</x><y>2</y><z>1</z></coordinates></vertex></vertices><volume><triangle><v1>0</v1><v2>1</v2><v3>2</v3></triangle></volume></mesh></object></amf>)"),
             std::nullopt);
  EXPECT_TRUE(test::near(sides_mm(amf.mesh), inches, 1e-3));
}

// A model with two objects: a triangle in two colours, and one that puts it twice. Another file holds a
// third.
std::string three_mf(const std::string& unit) {
  const std::string head = "<?xml version=\"1.0\"?><model unit=\"" + unit +
                           "\" xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" "
                           "xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\" "
                           "xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\">";
  const std::string vertices =
      "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"4\" y=\"0\" z=\"0\"/><vertex x=\"0\" "
      "y=\"2\" z=\"1\"/>"
      "</vertices><triangles><triangle v1=\"0\" v2=\"1\" v3=\"2\"";
  const std::string end = "/></triangles></mesh></object>";
  const std::string main =
      head +
      "<resources><basematerials id=\"1\"><base name=\"red\" displaycolor=\"#FF0000\"/></basematerials>"
      "<m:colorgroup id=\"2\"><m:color color=\"#0000FFFF\"/><m:color color=\"#008000\"/></m:colorgroup>"
      "<object id=\"3\" type=\"model\" pid=\"1\" pindex=\"0\">" +
      vertices + end + "<object id=\"4\">" + vertices + " pid=\"2\" p1=\"0\" p2=\"1\" p3=\"1\"" + end +
      "<object id=\"5\"><components><component objectid=\"4\" transform=\"1 0 0 0 1 0 0 0 1 10 0 0\"/>"
      "<component objectid=\"9\" p:path=\"/3D/Objects/more.model\" transform=\"0 1 0 -1 0 0 0 0 1 0 20 "
      "0\"/></components></object>"
      "</resources><build><item objectid=\"3\"/><item objectid=\"5\" transform=\"1 0 0 0 1 0 0 0 1 0 0 "
      "5\"/></build></model>";
  const std::string more =
      head + "<resources><object id=\"9\">" + vertices + end + "</resources><build/></model>";
  const std::string relations =
      "<?xml version=\"1.0\"?><Relationships><Relationship Target=\"/3D/parts.model\" Id=\"r\" "
      "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";
  return exchange::zipped(
             {{"_rels/.rels", relations}, {"3D/parts.model", main}, {"3D/Objects/more.model", more}})
      .value();
}

TEST(StatedUnit, OfA3mfWithComponentsAndColours) {
  const Mesh mesh = loaded(written("part.3mf", three_mf("inch")), std::nullopt).mesh;
  EXPECT_EQ(mesh.triangles.size(), 3U);
  const auto inch = [](double x, double y, double z) { return Vector3d(25.4 * x, 25.4 * y, 25.4 * z); };
  EXPECT_TRUE(test::near(colour_at(mesh, inch(4, 0, 0)), Vector3d(1, 0, 0), 1e-4));
  EXPECT_TRUE(test::near(colour_at(mesh, inch(10, 0, 5)), Vector3d(0, 0, 1), 1e-4));
  EXPECT_TRUE(test::near(colour_at(mesh, inch(14, 0, 5)), Vector3d(0, k_half_srgb, 0), 1e-4));
  EXPECT_TRUE(
      test::near(colour_at(mesh, inch(0, 24, 5)), Vector3d::Constant(0.6), 1e-4));  // turned by 90 degrees
  EXPECT_TRUE(test::near(sides_mm(mesh), inch(16, 24, 6), 1e-3));
  EXPECT_TRUE(test::near(sides_mm(loaded(written("mm.3mf", three_mf("millimeter")), std::nullopt).mesh),
                         Vector3d(16, 24, 6), 1e-3));
  EXPECT_TRUE(contains(error_of(written("none.3mf", "PK"), std::nullopt), "it is no zip file"));
}

TEST(StatedUnit, IsReplacedByAGivenOneWithANote) {
  const Loaded given = loaded(written("part.dae", k_collada), LengthUnit::centimetre);
  EXPECT_TRUE(test::near(sides_mm(given.mesh), Vector3d(40, 20, 10), 1e-3));
  EXPECT_TRUE(contains(given.messages, "is read in cm as given; the file itself says 0.0254 m"));
  EXPECT_TRUE(contains(error_of(written("part.obj", k_plate), std::nullopt), "expected its unit"));
}

}  // namespace
}  // namespace limn::scene
