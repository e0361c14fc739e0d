#include "session/drawing/frame_drawer.h"

#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "device/gl_context.h"
#include "session/frame_composer.h"
#include "session/perception.h"
#include "sim/virtual_rig.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"

namespace limn::session {
namespace {

using namespace test::literals;

// A session in the studio, at a quarter of the resolution.
class FrameDrawerTest : public ::testing::Test {
 protected:
  FrameDrawerTest()
      : world_(test::studio_world(0.25)),
        scene_(*world_.scene),
        seen_by_(world_.rig),
        rig_(world_, {.frame_period_s = 0.05, .grab_waits_for_light = false}),
        context_(device::GlContext::create().value()),
        perception_(Perception::create(scene_, seen_by_).value()),
        composer_(FrameComposer::create(scene_, seen_by_).value()),
        show_state_(scene::initial_show_state(scene_)) {}

  const ComposedFrame& compose(std::span<const std::string> dark = {}) {
    const int camera = 0;
    const Percepts& percepts = perception_.watch(rig_.expose(std::span(&camera, 1)));
    FrameInput input =
        frame_input(scene_, {}, percepts, show_state_, {rig_.now(), shifted(rig_.now(), 0.033)});
    input.dark_projectors = dark;
    return composer_.compose(input);
  }
  void move_mirror(const Eigen::Vector3d& by) {
    const std::string name = "marker-" + scene_.slots[0].marker.text();
    const auto object = std::ranges::find(rig_.world().objects, name, &sim::Object::name);
    ASSERT_NE(object, rig_.world().objects.end()) << name;
    Pose moved = object->world_from_object;
    moved.translation += by;
    rig_.move(name, moved);
  }

  sim::World world_;
  scene::Scene scene_;
  Rig seen_by_;
  sim::VirtualRig rig_;
  device::GlContext context_;
  Perception perception_;
  FrameComposer composer_;
  scene::ShowState show_state_;
};

double apart(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF); }

// A machine that draws from descriptions alone gets the composer's images, though it misses every third
// description: at rest, in motion, while a part fades, in a blackout, in a freeze.
TEST_F(FrameDrawerTest, DrawsTheComposersImagesFromDescriptionsThatItGets) {
  FrameDrawer drawer = FrameDrawer::create(&scene_, &seen_by_, draw_options({})).value();
  int compared = 0, moving = 0, fading = 0;
  cv::Mat before;
  for (int i = 0; i < 40; ++i) {
    if (i > 8 && i < 16) move_mirror({1_mm, 0, 0});
    if (i == 18) move_mirror({0, 0, 10});  // it is lost, and its part fades
    if (i == 28) move_mirror({0, 0, -10});
    show_state_.blackout = i >= 33 && i < 35;
    show_state_.frozen = i >= 36;
    if (i > 36) move_mirror({1_mm, 0, 0});
    const ComposedFrame& composed = compose();
    const FrameDescription& frame = composer_.description();
    moving += frame.is_moving;
    fading += !frame.fading.empty();
    if (i % 3 == 2) continue;
    for (std::size_t p = 0; p < composed.projectors.size(); ++p) {
      ASSERT_EQ(apart(drawer.image(frame, p).left, composed.projectors[p]), 0) << "frame " << i;
      ++compared;
    }
  }
  EXPECT_GT(moving, 8);
  EXPECT_LT(moving, 35);
  EXPECT_GT(fading, 2);
  EXPECT_GT(compared, 40);
}

// Where two projectors reach, the other one takes over; a projector that is back gives its share again.
TEST_F(FrameDrawerTest, OthersGiveTheLightOfADarkProjector) {
  ASSERT_EQ(seen_by_.projectors.size(), 2u);
  for (int i = 0; i < 4; ++i) compose();
  const std::vector<cv::Mat> both = compose().eye_images();
  const std::vector<std::string> dark = {seen_by_.projectors[1].name};
  const std::vector<cv::Mat> one = compose(dark).eye_images();
  const auto light = [](const cv::Mat& image) { return cv::sum(image)[1]; };
  EXPECT_GT(light(one[0]), 1.2 * light(both[0]));
  EXPECT_LT(light(one[1]), 0.6 * light(both[1]));
  const std::vector<cv::Mat> again = compose().eye_images();
  for (std::size_t p = 0; p < 2; ++p) EXPECT_NEAR(light(again[p]) / light(both[p]), 1, 0.02);
}

int linked = 0;  // programs, by counted_link()
PFNGLLINKPROGRAMPROC link_program = nullptr;
void counted_link(GLuint program) {
  ++linked;
  link_program(program);
}

// The number of programs that are linked for an image.
int programs_linked(FrameDrawer* drawer, const FrameDescription& frame, cv::Mat* image) {
  linked = 0;
  link_program = std::exchange(epoxy_glLinkProgram, &counted_link);
  *image = drawer->image(frame, 0).left.clone();
  epoxy_glLinkProgram = link_program;
  return linked;
}

TEST_F(FrameDrawerTest, LinksNothingForTheFirstLineWhenLinesWerePrepared) {
  for (int i = 0; i < 8; ++i) compose();
  const FrameDescription bare = composer_.description();
  ASSERT_TRUE(bare.posed.world_from_prototype);
  FrameDescription with_line = bare;
  scene::DrawnLine line;
  line.curve.points.resize(2);
  const scene::Mesh& door = scene_.prototype->mesh;
  for (std::size_t k = 0; k < 2; ++k)
    line.curve.points[k].p = door.positions[door.triangles[door.triangles.size() / 2][k]].cast<double>();
  with_line.posed.drawn.push_back(line);
  cv::Mat images[2][2];  // without and with preparation; bare, and with the line
  int count[2][2];
  for (const bool prepares : {false, true}) {
    ComposeOptions options;
    options.prepares_lines = prepares;
    FrameDrawer drawer = FrameDrawer::create(&scene_, &seen_by_, draw_options(options)).value();
    count[prepares][0] = programs_linked(&drawer, bare, &images[prepares][0]);
    count[prepares][1] = programs_linked(&drawer, with_line, &images[prepares][1]);
  }
  EXPECT_GT(count[false][1], 0);
  EXPECT_GT(count[true][0], 0);
  EXPECT_EQ(count[true][1], 0);
  EXPECT_GT(apart(images[false][0], images[false][1]), 0);  // the line is lit
  for (const int k : {0, 1}) EXPECT_EQ(apart(images[false][k], images[true][k]), 0) << k;
}

}  // namespace
}  // namespace limn::session
