// A session on the virtual rig that keeps real time: its effort changes while it runs.
#include <gtest/gtest.h>

#include <atomic>
#include <limits>

#include "device/gl_context.h"
#include "session/virtual_session.h"
#include "tests/session/studio.h"

namespace limn::session {
namespace {

// Ends the session some frames after the camera's images have got a width.
class EndsAtWidth final : public SessionClient {
 public:
  explicit EndsAtWidth(int width) : width_(width) {}
  void apply_edits(const SessionMoment&) override {}
  void publish_state(const SessionMoment& moment) override {
    if (!moment.shown || moment.session.percepts().frames[0].image.cols != width_) return;
    last = *moment.shown;
    ++frames_;
  }
  bool ends_session() const override { return frames_ >= 6; }

  ShownFrame last;

 private:
  int width_, frames_ = 0;
};

class RealTimeSession : public testing::Test {
 protected:
  RealTimeSession() : context_(device::GlContext::create().value()), whole_(studio_world(0.8).rig) {}

  // Begins at a share of the studio's resolution and ends at a width of the camera's images. Frames take
  // longer than any period of `period_s`, or less.
  void play(double share, int until_width, double period_s, std::size_t first) {
    const sim::World world = studio_world(share);
    SessionSetup setup;
    setup.rig = world.rig;
    setup.scene = *world.scene;
    rig_.emplace(world, virtual_rig_options(1 / 30.0));
    ScriptedRoom room = ScriptedRoom::create({}, &*rig_).value();
    output_.emplace(SessionOutput::open({}, {}, &setup).value());
    Perception perception = Perception::create(setup.scene, setup.rig, setup.watch).value();
    session_.emplace(Session::create(setup, &output_->telemetry(), nullptr, false).value());
    EndsAtWidth end(until_width);
    const RealTime real_time{
        whole_, period_s, {{1, {}, 0}, {0.5, {.edge_samples = 8, .lamp_points = 4}, 0.3}}, first};
    const std::atomic<bool> is_ended = false;
    const Status played = play_virtually(std::numeric_limits<double>::infinity(), &real_time, is_ended,
                                         &*rig_, &room, {perception, *session_, *output_, {&end}});
    ASSERT_TRUE(played) << played.message();
    last_ = end.last;
  }
  // Everything has the size of this camera width, and the session tracks and projects.
  void expect_size(int width) {
    EXPECT_EQ(session_->setup().rig.cameras[0].width, width);
    EXPECT_EQ(rig_->world().rig.cameras[0].width, width);
    EXPECT_EQ(session_->composed().projectors[0].cols, width * 2 / 3);
    EXPECT_TRUE(session_->composed().posed.world_from_prototype.has_value());
    EXPECT_EQ(session_->composed().posed.parts.size(), session_->setup().scene.slots.size());
    EXPECT_EQ(last_.lost, 0);
    EXPECT_GE(last_.placement_mm, 0);
    EXPECT_LT(last_.placement_mm, 2);
  }

  device::GlContext context_;
  Rig whole_;
  std::optional<sim::VirtualRig> rig_;
  std::optional<SessionOutput> output_;
  std::optional<Session> session_;
  ShownFrame last_;
};

TEST_F(RealTimeSession, BecomesCoarserWhenFramesTakeTooLong) {
  play(0.8, 768, 1e-6, 0);
  expect_size(768);
  EXPECT_NE(session_->pace().find("50 %"), std::string::npos) << session_->pace();
  ASSERT_FALSE(output_->telemetry().notes().empty());
  EXPECT_EQ(output_->telemetry().notes().back().second, session_->pace());
}

TEST_F(RealTimeSession, GetsItsResolutionBackWhenThereIsTime) {
  play(0.4, 1536, 1e3, 1);
  expect_size(1536);
  EXPECT_TRUE(session_->pace().empty()) << session_->pace();
  EXPECT_EQ(output_->telemetry().notes().size(), 2U) << "that it was coarser, and that it is whole again";
}

}  // namespace
}  // namespace limn::session
