// Who is given which image of the room, and when, without a network and without a camera.
#include "remote/api/request_handler.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <nlohmann/json.hpp>
#include <thread>

#include "scene/actions.h"

namespace limn::remote {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using Clock = RequestHandler::Clock;

constexpr const char* k_wants_room = R"({"type": "pictures", "room": true})";

class AReception : public testing::Test {
 protected:
  AReception() : handler_(setup()) {}

  RequestHandler::Setup setup() {
    RequestHandler::Setup out;
    out.authentication.cookie = "limn";
    out.set_has_guests = [](bool) {};
    out.post = [](const std::function<void()>& job) { job(); };
    out.submit_edit = [this](EditRequest request) { edits_.push_back(std::move(request)); };
    out.providers.draw_room = [this](ImageCallback answer) {
      drawing_requests_.push_back(std::move(answer));
    };
    return out;
  }

  std::shared_ptr<WebSocketPeer> client(Role role) {
    HttpRequest request;
    request.method = "POST";
    request.target = "/api/pair";
    request.host = "localhost";
    request.content_type = "application/json";
    request.body = json({{"pin", handler_.sessions().pin(role)}, {"name", "Ann"}}).dump();
    handler_.handle_request(request, [&](const HttpResponse& paired) {
      request.authorization = "Bearer " + json::parse(paired.body)["token"].get<std::string>();
    });
    request.target = "/api/live";
    auto out = std::get<std::shared_ptr<WebSocketPeer>>(handler_.accept_web_socket(request));
    out->open([] {});
    return out;
  }

  void wait_for_a_drawing_request() {
    for (const auto begun = Clock::now(); drawing_requests_.empty() && Clock::now() - begun < 20s;) {
      std::this_thread::sleep_for(20ms);
      handler_.update_at(Clock::now());
    }
  }

  // Answers the oldest drawing request with an image, after a while.
  void draw(std::uint8_t image, std::chrono::milliseconds after) {
    std::this_thread::sleep_for(after);
    ASSERT_FALSE(drawing_requests_.empty());
    const ImageCallback answer = std::move(drawing_requests_.front());
    drawing_requests_.pop_front();
    answer({R"({"why":""})", {image}});
  }

  // The last byte of the newest image that was sent to a client: '}' for one that is withheld; nullopt: none
  // was sent.
  static std::optional<char> newest_image_for(const std::shared_ptr<WebSocketPeer>& client) {
    std::optional<char> out;
    while (const auto sent = client->next_message())
      if (!sent->is_text) out = sent->bytes->back();
    return out;
  }

  std::deque<ImageCallback> drawing_requests_;
  std::vector<EditRequest> edits_;  // that were handed to the session
  RequestHandler handler_;
};

// A camera with the prototype's frame for its world: a sheet z = 0.03 sin(x / 0.1) m.
double height_at(double x) { return 0.03 * std::sin(x / 0.1); }

Imager camera_over_prototype() {
  Imager camera{"camera0", 1280, 960, {}, looking_at({0.2, -0.3, 1.1}, {0, 0, 0}, {0, 1, 0})};
  camera.lens = Lens::create("LENSMODEL_OPENCV4", {1400, 1400, 650, 470, -0.15, 0.1, 0.002, -0.001}).value();
  return camera;
}

scene::Scene scene_of_a_sheet() {
  scene::Mesh mesh;
  constexpr std::uint32_t k_count = 400;
  for (std::uint32_t i = 0; i <= k_count; ++i)
    for (const double y : {-0.2, 0.2}) {
      const double x = 0.4 * i / k_count - 0.2;
      mesh.positions.push_back(Eigen::Vector3d(x, y, height_at(x)).cast<float>());
      mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    }
  for (std::uint32_t i = 0; i < k_count; ++i) {
    const std::uint32_t a = 2 * i;
    mesh.triangles.push_back({a, a + 2, a + 3});
    mesh.triangles.push_back({a, a + 3, a + 1});
  }
  scene::Scene scene;
  scene.drape = std::make_shared<const scene::Drape>(mesh);
  return scene;
}

// Messages of 8 points, as a page sends them. The time is that of all of Limn but the next frame.
TEST_F(AReception, AStrokeThroughAPictureLiesWhereItWasDrawn) {
  const auto guest = client(Role::work), visitor = client(Role::look);
  guest->receive_text(k_wants_room);
  ASSERT_FALSE(drawing_requests_.empty());
  const Imager camera = camera_over_prototype();
  drawing_requests_.front()({R"({"why":""})", {'a'}, {}, camera});
  const auto wanted = [](double t) {
    const double x = 0.24 * t - 0.12;
    return Eigen::Vector3d(x, 0.05 * std::sin(9 * t), height_at(x));
  };
  const scene::Scene scene = scene_of_a_sheet();
  scene::ShowState state;
  std::vector<double> took_ms;
  constexpr int k_points = 200, k_in_message = 8;
  for (int begin = 0; begin <= k_points; begin += k_in_message) {
    json px = json::array();
    for (int i = begin; i < std::min(begin + k_in_message, k_points + 1); ++i) {
      const Eigen::Vector2d at = camera.project(wanted(1.0 * i / k_points)).value();
      px.push_back({at.x(), at.y()});
    }
    const auto begun = Clock::now();
    guest->receive_text(json({{"type", "stroke"},
                              {"id", begin},
                              {"what", "draw"},
                              {"line", "edge"},
                              {"from", "room"},
                              {"picture", 1},
                              {"px", px}})
                            .dump());
    ASSERT_EQ(edits_.size(), 1U);
    const auto after = scene::apply_edit(scene, state, {}, edits_[0].edit);
    ASSERT_TRUE(after) << after.message();
    state = *after;
    took_ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - begun).count());
    edits_.clear();
  }
  ASSERT_EQ(state.drawn.size(), 1U);
  double worst_mm = 0;
  const std::vector<scene::SurfacePoint>& points = state.drawn[0].curve.points;
  for (int i = 0; i <= 1000; ++i) {
    double nearest = 1;
    for (std::size_t k = 0; k + 1 < points.size(); ++k) {
      const Eigen::Vector3d a = points[k].p, ab = points[k + 1].p - a, p = wanted(i / 1000.0);
      nearest =
          std::min(nearest, (a + std::clamp((p - a).dot(ab) / ab.squaredNorm(), 0.0, 1.0) * ab - p).norm());
    }
    worst_mm = std::max(worst_mm, 1e3 * nearest);
  }
  std::sort(took_ms.begin(), took_ms.end());
  const double most_ms = took_ms[took_ms.size() * 95 / 100];
  fmt::print(
      "{} points, at most {:.3f} mm from where it was drawn; 95 % of messages took at most {:.1f} ms\n",
      points.size(), worst_mm, most_ms);
  EXPECT_LT(worst_mm, 0.5);
  EXPECT_LT(most_ms, 50);
  // A picture that was not sent, a role that may not, and points that the lens has no ray for.
  for (
      const char* wrong :
      {R"({"type": "stroke", "id": 1, "what": "draw", "line": "a", "from": "room", "picture": 77, "px": [[1, 2]]})",
       R"({"type": "stroke", "id": 1, "what": "draw", "line": "a", "from": "window", "picture": 1, "px": [[1, 2]]})",
       R"({"type": "stroke", "id": 1, "what": "wipe", "line": "a", "from": "room", "picture": 1, "px": [[1, 2]]})",
       R"({"type": "stroke", "id": 1, "what": "draw", "line": "a", "from": "room", "picture": 1, "px": []})",
       R"({"type": "stroke", "id": 1, "what": "draw", "line": "a", "from": "room", "picture": 1, "px": [[1, 1e9]]})"}) {
    guest->receive_text(wrong);
    EXPECT_TRUE(edits_.empty()) << wrong;
  }
  visitor->receive_text(
      R"({"type": "stroke", "id": 1, "what": "draw", "line": "a", "from": "room", "picture": 1, "px": [[640, 480]]})");
  EXPECT_TRUE(edits_.empty());
}

TEST_F(AReception, GivesANewcomerTheLastRoomImageWhileItRests) {
  const auto first = client(Role::look);
  first->receive_text(k_wants_room);
  draw('a', 200ms);  // and then it rests for 1.4 s
  EXPECT_EQ(newest_image_for(first), 'a');
  first->receive_text(R"({"type": "seen", "picture": 1})");
  EXPECT_EQ(newest_image_for(first), std::nullopt) << "the same again";
  const auto second = client(Role::look);
  second->receive_text(k_wants_room);
  EXPECT_EQ(newest_image_for(second), 'a');
  EXPECT_TRUE(drawing_requests_.empty()) << "projectors go first";
  wait_for_a_drawing_request();
  draw('b', 0ms);
  EXPECT_EQ(newest_image_for(first), 'b');
  EXPECT_EQ(newest_image_for(second), std::nullopt) << "one was not seen yet";
}

TEST_F(AReception, DrawsForANewcomerAtOnceWhatIsLongAgo) {
  const auto first = client(Role::look);
  first->receive_text(k_wants_room);
  draw('a', 600ms);  // and then it rests for 2.4 s
  first->close();
  std::this_thread::sleep_for(k_room_image_lasts + 100ms);
  const auto second = client(Role::look);
  second->receive_text(k_wants_room);
  EXPECT_EQ(newest_image_for(second), std::nullopt);
  draw('b', 0ms);
  EXPECT_EQ(newest_image_for(second), 'b');
}

TEST_F(AReception, GivesWhoComesBackFromTheWindowTheLastRoomImage) {
  const auto guest = client(Role::look);
  guest->receive_text(k_wants_room);
  draw('a', 200ms);
  guest->receive_text(R"({"type": "pictures", "room": false})");
  EXPECT_EQ(newest_image_for(guest), 'a');
  guest->receive_text(k_wants_room);
  EXPECT_EQ(newest_image_for(guest), 'a');
}

// It may have come when nothing was hidden any more.
TEST_F(AReception, GivesAnImageThatWasDrawnWhileTheRoomWasHiddenToNoLesserRole) {
  const auto works = client(Role::work), looks = client(Role::look);
  handler_.hide_room(Role::work, Clock::now() + 200ms);
  for (const auto& each : {works, looks}) each->receive_text(k_wants_room);
  draw('a', 300ms);
  EXPECT_EQ(newest_image_for(works), 'a');
  EXPECT_EQ(newest_image_for(looks), '}');
  const auto newcomer = client(Role::look);
  newcomer->receive_text(k_wants_room);
  EXPECT_EQ(newest_image_for(newcomer), '}');
  for (const auto& each : {works, looks, newcomer}) each->receive_text(R"({"type": "seen", "picture": 1})");
  wait_for_a_drawing_request();
  draw('b', 0ms);
  for (const auto& each : {works, looks, newcomer}) EXPECT_EQ(newest_image_for(each), 'b');
}

TEST_F(AReception, ShowsALesserRoleNoRoomWhileItIsHidden) {
  const auto first = client(Role::look);
  first->receive_text(k_wants_room);
  draw('a', 200ms);
  handler_.hide_room(Role::work, Clock::now() + 1min);
  const auto second = client(Role::look), third = client(Role::work);
  for (const auto& each : {second, third}) each->receive_text(k_wants_room);
  EXPECT_EQ(newest_image_for(second), '}');
  EXPECT_EQ(newest_image_for(third), 'a');
}

}  // namespace
}  // namespace limn::remote
