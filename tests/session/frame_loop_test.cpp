// The order of a frame is the same wherever a session runs.
#include "session/frame_loop.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

#include "core/scale_resolution.h"
#include "device/gl_context.h"
#include "sim/virtual_rig.h"
#include "tests/session/studio.h"
#include "tests/support/matchers.h"
#include "tracker/marker_image.h"

namespace limn::session {
namespace {

// Clock, source, sink and client in one; they note which functions are called.
class Notes final : public FrameClock, public FrameSource, public FrameSink, public SessionClient {
 public:
  Notes(sim::VirtualRig* rig, Perception* perception) : rig_(rig), perception_(perception) {}

  Stamp now() const override { return rig_->now(); }
  Result<std::optional<FrameTimes>> next_frame() override {
    if (!shows) return std::optional<FrameTimes>();
    return std::optional(FrameTimes{rig_->now(), shifted(rig_->now(), 0.04)});
  }
  bool is_over() const override { return steps == 0; }
  Result<Perceived> perceive() override {
    --steps;
    calls += "perceive ";
    const int camera = 0;
    Perceived out;
    out.percepts = perception_->watch(rig_->expose(std::span(&camera, 1)));
    out.moments = ++moments_;
    return out;
  }
  Status edit(Session* session) override {
    calls += "edit ";
    EXPECT_EQ(session->percepts().captured_at, perception_->percepts().captured_at)
        << "perceive() comes before edit()";
    return session->edit({"grid", "", "toggle"}, "test", now());
  }
  Status show(const ComposedFrame& painted, const std::vector<EyeImages>& light) override {
    calls += "show ";
    EXPECT_EQ(painted.painted_at, now());
    covered = cv::norm(light[0].left, painted.projectors[0], cv::NORM_INF) > 0;
    same = cv::norm(light[1].left, painted.projectors[1], cv::NORM_INF) == 0;
    return {};
  }
  void show_screens(std::span<const ScreenImages> screens) override {
    calls += screens.empty() ? "no-screens " : "screens ";
    for (const ScreenImages& screen : screens) drawn += screen.images.left.empty() ? 0 : 1;
  }
  double screen_interval_s() const override { return interval_s; }
  bool wants_screen() const override { return wants; }
  Stamp light_at(Stamp expected) const override { return shifted(expected, 0.007); }  // the next refresh
  void apply_edits(const SessionMoment&) override { calls += "client-edits "; }
  void publish_state(const SessionMoment& moment) override {
    calls += moment.shown ? "publish-shown " : "publish ";
    if (moment.shown) {
      EXPECT_EQ(moment.shown->shown_at, light_at(shifted(now(), 0.04)));
    }
  }
  std::vector<projector::Overlay> overlays(Session*) override {
    calls += "overlay ";
    return {projector::SignOverlay{0, cv::Mat(8, 8, CV_8UC3, cv::Scalar::all(255)), std::nullopt}};
  }
  bool ends_session() const override { return ends; }

  std::string calls;
  int steps = 0;
  bool shows = true, ends = false, covered = false, same = false, wants = false;
  double interval_s = 0;
  int drawn = 0;  // images of the screen

 private:
  sim::VirtualRig* rig_;
  Perception* perception_;
  std::size_t moments_ = 0;
};

class AFrameLoop : public testing::Test {
 protected:
  AFrameLoop() : context_(device::GlContext::create().value()) {
    const sim::World world = studio_world(0.25);
    setup_.rig = world.rig;
    setup_.scene = *world.scene;
    rig_.emplace(world, sim::VirtualRigOptions{.grab_waits_for_light = false});
    output_ = SessionOutput::open({}, {}, &setup_).value();
    perception_ = Perception::create(setup_.scene, setup_.rig).value();
    session_ = Session::create(setup_, nullptr, nullptr, false).value();
    notes_.emplace(&*rig_, &*perception_);
  }
  Status played(int steps) {
    notes_->steps = steps;
    notes_->calls.clear();
    FrameLoop loop({*perception_, *session_, *output_, {&*notes_}}, {*notes_, *notes_, *notes_, health_});
    return loop.run(is_ended_);
  }

  device::GlContext context_;
  SessionSetup setup_;
  std::optional<sim::VirtualRig> rig_;
  std::optional<SessionOutput> output_;
  std::optional<Perception> perception_;
  std::optional<Session> session_;
  std::optional<Notes> notes_;
  DeviceHealth health_;
  std::atomic<bool> is_ended_ = false;
};

TEST_F(AFrameLoop, GoesInOneOrder) {
  ASSERT_TRUE(played(1));
  EXPECT_EQ(notes_->calls, "perceive edit client-edits overlay show no-screens publish-shown ");
  EXPECT_TRUE(session_->show_state().grid) << "an edit counts in the same frame";
}

TEST_F(AFrameLoop, OverlaysAreInTheLightAndNotInWhatWasPainted) {
  ASSERT_TRUE(played(1));
  EXPECT_TRUE(notes_->covered);
  EXPECT_TRUE(notes_->same) << "the other projector's image has no overlay";
}

TEST_F(AFrameLoop, TakesInWhatChangesWhenNoImageIsDue) {
  notes_->shows = false;
  ASSERT_TRUE(played(2));
  EXPECT_EQ(notes_->calls, "perceive edit client-edits perceive edit client-edits ");
  EXPECT_EQ(session_->composed().painted_at, Stamp{});
}

TEST_F(AFrameLoop, DrawsTheScreenOnlyForThoseWhoLookAtIt) {
  ASSERT_TRUE(played(3));
  EXPECT_EQ(notes_->drawn, 0) << "nobody looks";
  notes_->wants = true;
  ASSERT_TRUE(played(3));
  EXPECT_EQ(notes_->drawn, 3);
  notes_->wants = false;
  ASSERT_TRUE(played(2));
  EXPECT_EQ(notes_->drawn, 3);
}

TEST_F(AFrameLoop, DrawsTheScreenNoMoreOftenThanTheSinkSays) {
  notes_->wants = true;
  notes_->interval_s = 3600;
  ASSERT_TRUE(played(4));
  EXPECT_EQ(notes_->drawn, 1);
}

TEST_F(AFrameLoop, EndsWhenAClientDoes) {
  notes_->ends = true;
  ASSERT_TRUE(played(5));
  EXPECT_EQ(notes_->steps, 4);
}

}  // namespace
}  // namespace limn::session
