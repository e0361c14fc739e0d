// Glasses without a marker, in a served session: pictures of their camera are located by the scene's markers.
#include "remote/tablet/camera_locator.h"

#include <gtest/gtest.h>

#include "device/gl_context.h"
#include "device/jpeg.h"
#include "session/perception.h"
#include "sim/virtual_rig.h"
#include "tests/remote/a_server.h"
#include "tests/remote/virtual_tablet.h"
#include "tests/support/worlds.h"

namespace limn::remote {
namespace {

constexpr int k_width = 640, k_height = 400, k_shots = 8;

json numbers(const Pose& pose, const char* key) {
  const Eigen::Quaterniond& q = pose.rotation;
  const Eigen::Vector3d& t = pose.translation;
  return std::string(key) == "rotation_wxyz" ? json({q.w(), q.x(), q.y(), q.z()})
                                             : json({t.x(), t.y(), t.z()});
}

// The studio, whose session knows where its markers are, and pictures of a camera that moves before it.
class CameraGlasses : public AServer {
 protected:
  void SetUp() override {
    AServer::SetUp();
    auto context = device::GlContext::create();
    ASSERT_TRUE(context) << context.message();
    context_.emplace(std::move(*context));
    sim::World world = test::studio_world(0.5);
    session::SessionSetup setup;
    setup.rig = world.rig;
    setup.scene = *world.scene;
    setup.scene.folder = folder_ / "project";
    fs::create_directories(setup.scene.folder);
    sim::VirtualRig rig(std::move(world), {.grab_waits_for_light = false});
    session::Perception perception = session::Perception::create(setup.scene, setup.rig).value();
    telemetry_.emplace(session::Telemetry::create({}).value());
    session_.emplace(session::Session::create(setup, &*telemetry_, nullptr, false).value());
    const int camera = 0;
    for (std::size_t i = 1; i <= 8; ++i)
      session_->update_percepts(perception.watch(rig.expose(std::span(&camera, 1))), i);
    const Stamp seen_at = session_->percepts().captured_at;
    session_->compose_and_record(seen_at, seen_at);
    std::vector<cv::Mat> white;
    for (const Imager& p : setup.rig.projectors)
      white.emplace_back(p.height, p.width, CV_8UC3, cv::Scalar::all(150));
    test::VirtualTablet glasses(rig.world(), white, k_width, k_height, 5);
    Lens& lens = glasses.world().rig.cameras[0].lens;
    lens = Lens::create("LENSMODEL_PINHOLE", {lens.fx(), lens.fx(), lens.values[2], lens.values[3]}).value();
    for (int i = 0; i < k_shots; ++i) shots_.push_back(glasses.shoot(0.15 * i));
    locator_ = CameraLocator::create(setup).value();
    ImageProviders providers;
    providers.update_session = [this](const session::Session& session) { locator_->update_session(session); };
    providers.locate_camera = [this](std::uint64_t number, const StatedLens& stated,
                                     std::vector<std::uint8_t> jpeg, LocatedCallback answer) {
      locator_->locate(number, stated, std::move(jpeg), std::move(answer));
    };
    open({}, std::move(providers));
  }
  void TearDown() override { server_.reset(); }

  // Plays the session in real time while a guest does something on another thread.
  void play_while(const std::function<void()>& guest) {
    std::atomic<bool> is_over = false;
    std::thread other([&] {
      guest();
      is_over = true;
    });
    while (!is_over) {
      const Stamp at = std::chrono::steady_clock::now();
      server_->apply_edits(&*session_, at);
      server_->publish_state(*session_, *telemetry_, health_, at);
      std::this_thread::sleep_for(10ms);
    }
    other.join();
  }

  Pose feed_from_view(int shot) const {
    const Pose turned(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero());
    return world_from_feed_.inverse() *
           shots_[static_cast<std::size_t>(shot)].camera.imager_from_world.inverse() * turned;
  }
  // The pose of a shot, and the announcement of its picture.
  json pose_message(int shot) const {
    const Pose pose = feed_from_view(shot);
    return {{"type", "glasses_pose"},
            {"at_s", seconds_since(begun_)},
            {"rotation_wxyz", numbers(pose, "rotation_wxyz")},
            {"translation_m", numbers(pose, "translation_m")}};
  }
  json view_message(int shot, std::uint32_t number) const {
    json out = pose_message(shot);
    const Lens& lens = shots_[static_cast<std::size_t>(shot)].camera.lens;
    out["type"] = "glasses_view";
    out["picture"] = number;
    out["width"] = k_width;
    out["height"] = k_height;
    out["lens_px"] = {lens.fx(), lens.fx(), lens.values[2], lens.values[3]};
    return out;
  }
  std::string image_of(int shot, std::uint32_t number) const {
    const auto& jpeg = shots_[static_cast<std::size_t>(shot)].jpeg;
    return number_bytes(number) + std::string(jpeg.begin(), jpeg.end());
  }

  std::optional<device::GlContext> context_;
  std::optional<session::Telemetry> telemetry_;
  std::optional<session::Session> session_;
  session::DeviceHealth health_;
  std::vector<test::TabletShot> shots_;
  std::unique_ptr<CameraLocator> locator_;
  Pose world_from_feed_{exp_rotation({0.4, -1.1, 0.7}), {0.5, -1.2, 0.3}};
  Clock::time_point begun_ = Clock::now();
};

TEST_F(CameraGlasses, AreRegisteredAndWrongPicturesAreRefused) {
  const auto ann = guest(Role::look, "Ann");
  json place, refusals = json::array();
  play_while([&] {
    ann->message_of("state");
    ann->send_text(R"({"type": "glasses", "on": true})");
    refusals.push_back(json::parse(ann->message_of("refused").value_or("{}")).value("why", ""));
    ann->send_text(R"({"type": "glasses", "on": true, "camera": true})");
    std::uint32_t number = 0;
    for (int i = 0; i < 80; ++i) {
      const int shot = i / k_shots % 2 ? k_shots - 1 - i % k_shots : i % k_shots;
      ann->send_text(pose_message(shot).dump());
      ann->send_text(view_message(shot, ++number).dump());
      ann->send_binary(image_of(shot, number));
      std::this_thread::sleep_for(120ms);
      while (const auto message = ann->message_of("glasses", 0.01)) place = json::parse(*message);
      if (place["state"] == "registered" && i > 12) break;
    }
    const auto refused = [&](const json& view, const std::string& image) {
      ann->send_text(view.dump());
      ann->send_binary(image);
      refusals.push_back(json::parse(ann->message_of("refused").value_or(R"({"why": "none"})"))["why"]);
    };
    json view = view_message(0, 900);
    view["lens_px"] = {1e9, 500, 320, 200};
    refused(view, image_of(0, 900));
    view = view_message(0, 901);
    view["rotation_wxyz"] = {0.1, 0, 0, 0};
    refused(view, image_of(0, 901));
    refused(view_message(0, 902), image_of(0, 7));
    std::string half = image_of(0, 903);
    half.resize(half.size() / 2);
    refused(view_message(0, 903), half);
    std::this_thread::sleep_for(1100ms);  // what the locator refuses is sent once a second
    view = view_message(0, 904);
    view["width"] = k_height;
    view["lens_px"] = {300, 300, 200, 200};
    refused(view, image_of(0, 904));
  });
  ASSERT_EQ(place["state"], "registered") << place;
  EXPECT_EQ(place["marker"], "camera");
  EXPECT_EQ(place["markers"], json({"camera"}));
  const json& feed = place["world_from_feed"];
  const Pose found(Eigen::Quaterniond(feed[0], feed[1], feed[2], feed[3]),
                   Eigen::Vector3d(feed[4], feed[5], feed[6]));
  const Vector6d off = boxminus(found * feed_from_view(0), world_from_feed_ * feed_from_view(0));
  fmt::print("off by {:.2f} mm, {:.3f} degrees; stated {} mm, {} degrees\n", 1e3 * off.tail<3>().norm(),
             off.head<3>().norm() * 180 / 3.14159, place["eye_stddev_mm"].get<double>(),
             place["eye_stddev_deg"].get<double>());
  EXPECT_LT(off.tail<3>().norm(), 4e-3);
  EXPECT_LT(off.head<3>().norm(), 5e-3);
  const char* wanted[] = {"camera-access",
                          "focal length",
                          "quaternion of length 1",
                          "expected picture 902, found 7",
                          "damaged",
                          "expected 400 x 400 pixels"};
  for (std::size_t i = 0; i < std::size(wanted); ++i)
    EXPECT_NE(refusals[i].get<std::string>().find(wanted[i]), std::string::npos) << refusals;
  EXPECT_EQ(server_->glasses().size(), 1u);
}

}  // namespace
}  // namespace limn::remote
