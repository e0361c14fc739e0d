// Glasses as the server handles them: messages, markers, guests; by the clock of the test.
#include "remote/api/glasses_clients.h"

#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "remote/glasses/glasses_messages.h"
#include "tests/remote/a_headset.h"
#include "tests/support/matchers.h"

namespace limn::remote {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using test::Headset;
using Clock = GlassesClients::Clock;
using ClientPtr = std::shared_ptr<WsClient>;

constexpr std::size_t k_most_bytes = 2000;  // of a frame's messages

// A scene with a part and two viewers with markers, and guests without a network.
class SomeGlasses : public testing::Test {
 protected:
  SomeGlasses() {
    scene_.viewers.resize(2);
    scene_.viewers[0].marker = MarkerName{"apriltag_36h11", "7"};
    scene_.viewers[1].marker = MarkerName{"apriltag_36h11", "8"};
    scene_.slots.resize(1);
    scene_.slots[0].name = "mirror";
  }

  ClientPtr guest(const std::string& name) {
    auto client = std::make_shared<WsClient>();
    client->guest.name = name;
    client->wake = [] {};
    clients_.push_back(client);
    return client;
  }

  static Clock::time_point moment(double at_s) {
    return Clock::time_point(
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(at_s)));
  }

  SessionUpdate update(double at_s) const {
    SessionUpdate out;
    out.scene = std::make_shared<scene::Scene>(scene_);
    out.scenes = 1;
    out.posed.world_from_prototype = Pose();
    out.posed.parts = {{"mirror", "a", Pose(Eigen::Quaterniond::Identity(), {0.1, 0.2, 0.3})}};
    out.at = shifted(Stamp{}, at_s);
    out.made_at = moment(at_s);
    return out;
  }

  // A person with a headset looks round; `viewer` is the viewer whose marker the cameras see on it.
  void look_round(double until_s, const ClientPtr& client, Headset* headset, std::size_t viewer = 0) {
    std::vector<Track> tracks;
    headset->play(
        until_s,
        [&](const Pose& feed, double page_s, double received_s) {
          const Eigen::Quaterniond& q = feed.rotation;
          const Status received = glasses_.receive_pose(
              client, {page_s, {q.w(), q.x(), q.y(), q.z()}, feed.translation}, moment(received_s));
          EXPECT_TRUE(received) << received.message();
        },
        [&](const MeasuredMarker& marker) {
          Track track;
          track.body = scene::viewer_body(viewer);
          track.world_from_body = marker.world_from_marker;
          track.covariance = marker.covariance;
          track.captured_at = shifted(Stamp{}, marker.at_s);
          tracks.push_back(track);
        },
        [&](double at_s) {
          SessionUpdate next = update(at_s);
          next.viewer_tracks = std::exchange(tracks, {});
          glasses_.apply_update(next);
          glasses_.update_at(moment(at_s));
          collect(client);
        });
  }

  // Keeps the newest message of each type, and the most bytes that came at once.
  void collect(const ClientPtr& client) {
    std::size_t bytes = 0;
    while (const auto message = client->outbox.next_message()) {
      bytes += message->bytes->size();
      const json parsed = json::parse(*message->bytes);
      newest_[parsed["type"]] = parsed;
    }
    most_bytes_ = std::max(most_bytes_, bytes);
  }

  scene::Scene scene_;
  WsClients clients_;
  std::map<std::string, std::optional<Eigen::Vector3d>> viewpoints_;
  GlassesClients glasses_{&clients_,
                          [this](const std::string& name, const auto& p) { viewpoints_[name] = p; }};
  std::map<std::string, json> newest_;
  std::size_t most_bytes_ = 0;
};

TEST_F(SomeGlasses, GetTheirPlaceAndThePartsInFewBytes) {
  auto rng = test::test_rng();
  Headset headset(rng());
  const ClientPtr ann = guest("Ann");
  glasses_.apply_update(update(100));
  ASSERT_TRUE(glasses_.update_glasses(ann, {true, ""}));
  look_round(101, ann, &headset);
  EXPECT_EQ(newest_["glasses"]["state"], "looking_round") << newest_["glasses"];
  EXPECT_FALSE(newest_["glasses"].contains("world_from_feed"));
  EXPECT_FALSE(viewpoints_.contains("Ann")) << "a place is not guessed";
  look_round(111, ann, &headset);
  const json& place = newest_["glasses"];
  ASSERT_EQ(place["state"], "registered") << place;
  EXPECT_EQ(place["marker"], "apriltag_36h11:7");
  EXPECT_EQ(place["covariance"].size(), 21u);
  EXPECT_LT(place["eye_stddev_mm"].get<double>(), 2);
  EXPECT_EQ(newest_["glasses_parts"]["parts"][0],
            json::parse(R"(["mirror", "a", [1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3], "view"])"));
  ASSERT_TRUE(viewpoints_["Ann"]);
  EXPECT_LT((*viewpoints_["Ann"] - headset.world_from_eye(headset.at_s()).translation).norm(), 0.03);
  EXPECT_LE(most_bytes_, k_most_bytes);
}

TEST_F(SomeGlasses, GetThePlaneThatCutsAPartInItsOwnFrame) {
  scene_.section.emplace();
  scene_.section->slots = {"mirror"};
  scene_.section->hatch_m = 0.005;
  SessionUpdate shown = update(100);
  const auto part_of = [&] { return json::parse(glasses_parts_message(shown.posed, scene_, 1))["parts"][0]; };
  EXPECT_EQ(part_of().size(), 4u);
  shown.posed.cut = scene::CutPlane{{0, 0, 1}, 0.35};  // the part is at z = 0.3
  const json cut = part_of()[4];
  EXPECT_EQ(cut["normal"], json({0, 0, 1}));
  EXPECT_NEAR(cut["offset_m"].get<double>(), 0.05, 1e-9);
  const Eigen::Vector3d hatch(cut["hatch"][0], cut["hatch"][1], cut["hatch"][2]);
  EXPECT_NEAR(hatch.norm(), 200, 0.2) << "lines in a metre";
  EXPECT_NEAR(hatch.z(), 0, 0.1) << "along the plane";
  EXPECT_EQ(cut["colour"].size(), 3u);
  scene_.section->slots.clear();
  EXPECT_EQ(part_of().size(), 4u);
}

TEST_F(SomeGlasses, TheirLossIsSentAndEndsTheViewpoint) {
  auto rng = test::test_rng();
  Headset headset(rng());
  const ClientPtr ann = guest("Ann");
  glasses_.apply_update(update(100));
  ASSERT_TRUE(glasses_.update_glasses(ann, {true, ""}));
  look_round(111, ann, &headset);
  ASSERT_EQ(newest_["glasses"]["state"], "registered");
  viewpoints_.clear();
  ASSERT_TRUE(glasses_.receive_state(ann, {.is_asleep = true}));
  EXPECT_TRUE(glasses_.update_at(moment(111.01)));
  collect(ann);
  EXPECT_EQ(newest_["glasses"]["state"], "asleep");
  EXPECT_FALSE(newest_["glasses"].contains("world_from_feed"));
  EXPECT_TRUE(viewpoints_.empty());
  ASSERT_TRUE(glasses_.update_glasses(ann, {false, ""}));
  ASSERT_TRUE(viewpoints_.contains("Ann"));
  EXPECT_FALSE(viewpoints_["Ann"]);
  EXPECT_NE(glasses_.receive_pose(ann, {}, moment(112)).message().find("puts them on before"),
            std::string::npos);
}

TEST_F(SomeGlasses, EachPairNeedsItsOwnMarker) {
  const ClientPtr ann = guest("Ann"), ben = guest("Ben"), cleo = guest("Cleo");
  EXPECT_NE(glasses_.update_glasses(ann, {true, ""}).message().find("expected a viewer with a marker"),
            std::string::npos);
  glasses_.apply_update(update(100));
  ASSERT_TRUE(glasses_.update_glasses(ann, {true, ""}));
  EXPECT_EQ(ann->glasses->marker, "apriltag_36h11:7");
  EXPECT_NE(glasses_.update_glasses(ben, {true, "apriltag_36h11:7"}).message().find("on the glasses of Ann"),
            std::string::npos);
  EXPECT_NE(glasses_.update_glasses(ben, {true, "apriltag_36h11:9"})
                .message()
                .find("apriltag_36h11:7, apriltag_36h11:8"),
            std::string::npos);
  ASSERT_TRUE(glasses_.update_glasses(ben, {true, ""}));
  EXPECT_EQ(ben->glasses->marker, "apriltag_36h11:8");
  EXPECT_FALSE(glasses_.update_glasses(cleo, {true, ""}));
  ASSERT_TRUE(glasses_.update_glasses(ann, {false, ""}));
  EXPECT_TRUE(glasses_.update_glasses(cleo, {true, ""}));
}

TEST_F(SomeGlasses, WrongPosesAreRefusedOnceASecond) {
  const ClientPtr ann = guest("Ann");
  glasses_.apply_update(update(100));
  ASSERT_TRUE(glasses_.update_glasses(ann, {true, ""}));
  int refusals = 0;
  for (int i = 0; i < 300; ++i)
    refusals += !glasses_.receive_pose(ann, {5 + 0.01 * i, {2, 0, 0, 0}, {0, 0, 0}}, moment(100 + 0.01 * i));
  EXPECT_EQ(refusals, 3);
  EXPECT_FALSE(ann->glasses->registration.world_from_eye());
}

TEST(GlassesMessages, AreParsed) {
  const auto pose = parse_message(
      R"({"type": "glasses_pose", "at_s": 1.5, "rotation_wxyz": [1, 0, 0, 0], "translation_m": [0, 1.6, 0]})");
  ASSERT_TRUE(pose) << pose.message();
  EXPECT_EQ(std::get<GlassesPoseMessage>(*pose).translation_m, Eigen::Vector3d(0, 1.6, 0));
  for (
      const char* wrong :
      {R"({"type": "glasses_pose", "at_s": null, "rotation_wxyz": [1, 0, 0, 0], "translation_m": [0, 0, 0]})",
       R"({"type": "glasses_pose", "at_s": 1, "rotation_wxyz": [1, 0, 0], "translation_m": [0, 0, 0]})",
       R"({"type": "glasses_pose", "at_s": 1, "rotation_wxyz": [1, 0, 0, null], "translation_m": [0, 0, 0]})",
       R"({"type": "glasses_pose", "at_s": 1, "rotation_wxyz": [1, 0, 0, NaN], "translation_m": [0, 0, 0]})",
       R"({"type": "glasses_state", "is": "happy"})", R"({"type": "glasses", "on": 1})"}) {
    const auto refused = parse_message(wrong);
    ASSERT_FALSE(refused) << wrong;
    EXPECT_NE(refused.message().find("expected"), std::string::npos) << refused.message();
  }
}

}  // namespace
}  // namespace limn::remote
