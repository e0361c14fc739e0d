// Who is given which image of the room, and when, without a network and without a camera.
#include "remote/api/request_handler.h"

#include <gtest/gtest.h>

#include <deque>
#include <nlohmann/json.hpp>
#include <thread>

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
  RequestHandler handler_;
};

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
  draw('a', 600ms);  // and then it rests for 4.2 s
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
