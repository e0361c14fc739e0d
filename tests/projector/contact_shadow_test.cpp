#include "projector/contact_shadow.h"

#include <cmath>
#include <iostream>
#include <opencv2/core.hpp>

#include "core/image_io.h"
#include "projector/renderer.h"
#include "sim/ray_scene.h"
#include "tests/projector/gl_test.h"
#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using scene::Mesh;

// A box; each side has its own corners.
Mesh box(const Vector3d& lower, const Vector3d& upper) {
  Mesh mesh;
  for (int axis = 0; axis < 3; ++axis)
    for (const bool is_upper : {false, true}) {
      const auto first = static_cast<std::uint32_t>(mesh.positions.size());
      for (int k = 0; k < 4; ++k) {
        Vector3d p;
        p[axis] = (is_upper ? upper : lower)[axis];
        p[(axis + 1) % 3] = (k & 1 ? upper : lower)[(axis + 1) % 3];
        p[(axis + 2) % 3] = (k & 2 ? upper : lower)[(axis + 2) % 3];
        mesh.positions.push_back(p.cast<float>());
        mesh.normals.push_back((is_upper ? 1.f : -1.f) * Eigen::Vector3f::Unit(axis));
      }
      mesh.triangles.push_back({first, first + 1, first + 2});
      mesh.triangles.push_back({first + 2, first + 1, first + 3});
    }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
}

// A board at z = 0, seen from -z, and a block in front of it at a distance of `gap`.
scene::Scene block_before_a_board(double gap, scene::Mode mode) {
  scene::Scene scene;
  scene.prototype = scene::Prototype{box({-0.25, -0.2, 0}, {0.25, 0.2, 0.01}), {}, 0.8, {}};
  scene::Slot slot;
  slot.name = "block";
  slot.mode = mode;
  slot.variants.push_back({"a", box({-0.05, -0.03, -0.04 - gap}, {0.05, 0.03, -gap})});
  scene.slots.push_back(slot);
  return scene;
}

scene::PosedScene posed_with(const Pose& world_from_block) {
  scene::PosedScene posed;
  posed.world_from_prototype = Pose();
  posed.parts.push_back({"block", "a", world_from_block});
  return posed;
}

Rig one_camera() {
  Rig rig;
  const Pose camera_from_world = looking_at({-0.3, -0.35, -0.6}, {0, 0, 0}, {0, -1, 0});
  rig.cameras = {{"camera0", 640, 480, Lens::pinhole(700, 700, 320, 240), camera_from_world}};
  rig.projectors = {{"projector0", 320, 240, Lens::pinhole(350, 350, 160, 120),
                     looking_at({0, 0, -0.8}, {0, 0, 0}, {0, -1, 0})}};
  return rig;
}

const cv::Mat& grey_image() {
  static const cv::Mat image(480, 640, CV_8UC3, cv::Scalar::all(200));
  return image;
}

class ContactShadowTest : public test::GlTest {
 protected:
  static Renderer renderer(const scene::Scene& scene, const Rig& rig, bool with_shadow) {
    auto made = Renderer::create(scene, rig);
    if (!made) throw std::runtime_error(made.message());
    if (with_shadow) {
      EXPECT_TRUE(made->set_contact_shadow(&scene));
    }
    return std::move(made).value();
  }
};

TEST(DistanceField, IsTheDistanceFromABoxOnBothSides) {
  constexpr int k_nodes = DistanceField::k_nodes;
  const Vector3d lower(-0.05, -0.03, 0), upper(0.05, 0.03, 0.04);
  const DistanceField field = distance_field(box(lower, upper), 0.05);
  ASSERT_EQ(field.distances.size(), k_nodes * k_nodes * k_nodes);
  EXPECT_LT((field.p_lower.cast<double>() - (lower - Vector3d::Constant(0.05))).norm(), 1e-6);
  double worst = 0;
  for (int z = 0; z < k_nodes; ++z)
    for (int y = 0; y < k_nodes; ++y)
      for (int x = 0; x < k_nodes; ++x) {
        const Vector3d size = (field.p_upper - field.p_lower).cast<double>();
        const Vector3d p =
            field.p_lower.cast<double>() + Vector3d(x, y, z).cwiseProduct(size) / (k_nodes - 1);
        const Vector3d outside = (lower - p).cwiseMax(p - upper);
        const double truth = outside.maxCoeff() > 0 ? outside.cwiseMax(0).norm() : -outside.maxCoeff();
        const auto at = static_cast<std::size_t>((z * k_nodes + y) * k_nodes + x);
        worst = std::max(worst, std::abs(static_cast<double>(field.distances[at]) - std::min(truth, 0.05)));
      }
  EXPECT_LT(worst, 1e-6);
}

// The share of uniform light from all sides that the block keeps from a point of the board; farther parts of
// the block count less.
double traced_shadow(const sim::RayScene& block, const Vector3d& p) {
  constexpr int k_rings = 16, k_turns = 32;
  double kept = 0;
  for (int i = 0; i < k_rings; ++i)
    for (int k = 0; k < k_turns; ++k) {
      const double sine = std::sqrt((i + 0.5) / k_rings), turn = 2 * M_PI * (k + 0.5 * (i % 2)) / k_turns;
      const Vector3d d(sine * std::cos(turn), sine * std::sin(turn), -std::sqrt(1 - sine * sine));
      const sim::Hit hit = block.first_hit({p, d});
      if (hit.object >= 0) kept += std::max(0.0, 1 - hit.distance / ContactShadow::k_free);
    }
  return kept / (k_rings * k_turns);
}

TEST_F(ContactShadowTest, IsNearTheOneThatRaysFind) {
  const Rig rig = one_camera();
  for (const double gap : {0.0005, 0.008, 0.02}) {
    const scene::Scene scene = block_before_a_board(gap, scene::Mode::view);
    const Pose world_from_block(exp_rotation({0, 0, 0.5}), {0.03, -0.02, 0});
    Renderer drawing = renderer(scene, rig, true);
    const cv::Mat out = drawing.composite(0, grey_image(), posed_with(world_from_block), Composite::full);
    const sim::MeshInstance board{&scene.prototype->mesh, Pose()};
    const sim::MeshInstance placed{&scene.slots[0].variants[0].mesh, world_from_block};
    const sim::RayScene block(std::span(&placed, 1)), prototype(std::span(&board, 1));
    const auto sees_block = [&](int column, int row) {  // sees the block within one pixel
      for (const Vector2d& d : {Vector2d(-1, -1), {1, -1}, {-1, 1}, {1, 1}})
        if (block.first_hit(*rig.cameras[0].ray(Vector2d(column, row) + d)).object >= 0) return true;
      return false;
    };
    double squares = 0, worst = 0, darkest = 0, darkest_truth = 0;
    int count = 0;
    for (int row = 0; row < out.rows; row += 3)
      for (int column = 0; column < out.cols; column += 3) {
        const Ray ray = *rig.cameras[0].ray(Vector2d(column, row));
        const sim::Hit behind = prototype.first_hit(ray);
        if (behind.object < 0 || sees_block(column, row)) continue;
        const Vector3d p = ray.p_origin + behind.distance * ray.d;
        if (std::abs(p.z()) > 1e-6) continue;  // the board's rim
        const double truth = traced_shadow(block, p);
        const double found =
            1 - linear_from_srgb(out.at<cv::Vec3b>(row, column)[1] / 255.0) / linear_from_srgb(200 / 255.0);
        darkest = std::max(darkest, found);
        darkest_truth = std::max(darkest_truth, truth);
        worst = std::max(worst, std::abs(found - truth));
        if (truth < 0.01 && found < 0.01) continue;
        squares += std::pow(found - truth, 2);
        ++count;
      }
    const double rms = std::sqrt(squares / std::max(1, count));
    std::cout << "gap " << 1e3 * gap << " mm: " << count << " points, RMS " << rms << ", worst " << worst
              << ", darkest " << darkest << ", by rays " << darkest_truth << "\n";
    EXPECT_GT(count, 300);
    EXPECT_LT(rms, 0.05);
    EXPECT_LT(worst, 0.16);
  }
}

TEST_F(ContactShadowTest, LeavesProjectorImagesAndSurfacePartsAndWhatIsFarAlone) {
  const Rig rig = one_camera();
  for (const auto& [mode, gap] :
       {std::pair(scene::Mode::view, 0.0), {scene::Mode::view, 0.08}, {scene::Mode::surface, 0.0}}) {
    const scene::Scene scene = block_before_a_board(gap, mode);
    Renderer with = renderer(scene, rig, true), without = renderer(scene, rig, false);
    const scene::PosedScene posed = posed_with(Pose());
    EXPECT_EQ(cv::norm(with.projector_image(0, posed, rig.cameras[0]),
                       without.projector_image(0, posed, rig.cameras[0]), cv::NORM_INF),
              0);
    for (const Composite what : {Composite::full, Composite::rest}) {
      const cv::Mat dark = with.composite(0, grey_image(), posed, what);
      const cv::Mat plain = without.composite(0, grey_image(), posed, what);
      const bool expected = mode == scene::Mode::view && gap == 0;
      EXPECT_EQ(cv::norm(dark, plain, cv::NORM_INF) > 30, expected);
      EXPECT_TRUE(with.set_contact_shadow(nullptr));
      EXPECT_EQ(cv::norm(with.composite(0, grey_image(), posed, what), plain, cv::NORM_INF), 0);
      EXPECT_TRUE(with.set_contact_shadow(&scene));
    }
  }
}

}  // namespace
}  // namespace limn::projector
