// What is at rest keeps its pose to the last bit, so that it is not drawn again.
#include "session/stillness.h"

#include <gtest/gtest.h>

#include "tests/session/studio.h"

namespace limn::session {
namespace {

class PartsAtRest : public testing::Test {
 protected:
  PartsAtRest() : scene_(*studio_world(0.25).scene), boxes_(scene_) {
    shown_.world_from_prototype = Pose(Eigen::Quaterniond::Identity(), {0.1, 0.2, 0.3});
    shown_.parts.push_back({scene_.slots[0].name, scene_.slots[0].variants[0].name,
                            Pose(exp_rotation({0.1, 0.2, 0.3}), {0.2, 0.1, 0.4})});
  }
  // Whether a part that was measured there keeps its shown pose.
  bool keeps(const scene::PosedScene& measured) const {
    scene::PosedScene posed = measured;
    keep_parts_still(shown_, boxes_, &posed);
    const Pose &before = shown_.parts[0].world_from_part, &now = posed.parts[0].world_from_part;
    const Pose& given = measured.parts[0].world_from_part;
    const bool is_kept =
        now.translation == before.translation && now.rotation.coeffs() == before.rotation.coeffs();
    EXPECT_TRUE(is_kept ||
                (now.translation == given.translation && now.rotation.coeffs() == given.rotation.coeffs()));
    return is_kept;
  }

  scene::Scene scene_;
  scene::PartBoxes boxes_;
  scene::PosedScene shown_;
};

TEST_F(PartsAtRest, KeepTheirPosesDespiteJitter) {
  scene::PosedScene measured = shown_;
  measured.parts[0].world_from_part.translation.x() += 0.05e-3;
  EXPECT_TRUE(keeps(measured));
}

TEST_F(PartsAtRest, MoveWhenTheyAreMovedVisibly) {
  scene::PosedScene measured = shown_;
  measured.parts[0].world_from_part.translation.x() += 0.12e-3;
  EXPECT_FALSE(keeps(measured));
}

TEST_F(PartsAtRest, MoveWhenATurnMovesACorner) {
  scene::PosedScene measured = shown_;
  Pose& pose = measured.parts[0].world_from_part;
  pose.rotation = pose.rotation * exp_rotation({0, 0, 0.01});
  EXPECT_FALSE(keeps(measured));
}

TEST_F(PartsAtRest, MoveWithThePrototype) {
  scene::PosedScene measured = shown_;
  measured.world_from_prototype->translation.z() += 0.2e-3;
  measured.parts[0].world_from_part.translation.z() += 0.05e-3;
  EXPECT_FALSE(keeps(measured));
}

TEST_F(PartsAtRest, AnotherVariantHasItsOwnPose) {
  ASSERT_GT(scene_.slots[0].variants.size(), 1U);
  scene::PosedScene measured = shown_;
  measured.parts[0].variant = scene_.slots[0].variants[1].name;
  measured.parts[0].world_from_part.translation.x() += 0.05e-3;
  EXPECT_FALSE(keeps(measured));
}

}  // namespace
}  // namespace limn::session
