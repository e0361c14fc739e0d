// Who is given which image of the room, and when, without a network and without a camera.
#include "remote/api/reception.h"

#include <gtest/gtest.h>

#include <deque>
#include <nlohmann/json.hpp>
#include <thread>

namespace limn::remote {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using Clock = Reception::Clock;

constexpr const char* k_wants_room = R"({"type": "pictures", "room": true})";

class AReception : public testing::Test {
 protected:
  AReception() : reception_(setup()) {}

  Reception::Setup setup() {
    Reception::Setup out;
    out.cookie = "limn";
    out.watched = [](bool) {};
    out.post = [](const std::function<void()>& job) { job(); };
    out.providers.draw_room = [this](ImageCallback answer) { asked_.push_back(std::move(answer)); };
    return out;
  }

  std::shared_ptr<WsClient> client(Role role) {
    HttpRequest request;
    request.method = "POST";
    request.target = "/api/pair";
    request.host = "localhost";
    request.content_type = "application/json";
    request.body = json({{"pin", reception_.guests().pin(role)}, {"name", "Ann"}}).dump();
    reception_.handle_request(request, [&](const HttpResponse& paired) {
      request.authorization = "Bearer " + json::parse(paired.body)["token"].get<std::string>();
    });
    request.target = "/api/live";
    auto out = std::get<std::shared_ptr<WsClient>>(reception_.admit(request));
    out->wake = [] {};
    reception_.greet(out);
    return out;
  }

  void rest_to_the_end() {
    for (const auto begun = Clock::now(); asked_.empty() && Clock::now() - begun < 20s;) {
      std::this_thread::sleep_for(20ms);
      reception_.update_at(Clock::now());
    }
  }

  // Draws what was asked for first, after so long.
  void draw(std::uint8_t image, std::chrono::milliseconds after) {
    std::this_thread::sleep_for(after);
    ASSERT_FALSE(asked_.empty());
    const ImageCallback answer = std::move(asked_.front());
    asked_.pop_front();
    answer({R"({"why":""})", {image}});
  }

  // The last byte of the image that a visitor was sent, '}' of one that is withheld; nullopt: none was
  // sent.
  static std::optional<char> shown_to(const std::shared_ptr<WsClient>& client) {
    std::optional<char> out;
    while (const auto sent = client->outbox.next_message())
      if (!sent->is_text) out = sent->bytes->back();
    return out;
  }

  std::deque<ImageCallback> asked_;
  Reception reception_;
};

TEST_F(AReception, GivesANewcomerTheLastRoomImageWhileItRests) {
  const auto first = client(Role::look);
  reception_.hear_text(first, k_wants_room);
  draw('a', 200ms);  // and then it rests for 1.4 s
  EXPECT_EQ(shown_to(first), 'a');
  reception_.hear_text(first, R"({"type": "seen", "picture": 1})");
  EXPECT_EQ(shown_to(first), std::nullopt) << "the same again";
  const auto second = client(Role::look);
  reception_.hear_text(second, k_wants_room);
  EXPECT_EQ(shown_to(second), 'a');
  EXPECT_TRUE(asked_.empty()) << "projectors go first";
  rest_to_the_end();
  draw('b', 0ms);
  EXPECT_EQ(shown_to(first), 'b');
  EXPECT_EQ(shown_to(second), std::nullopt) << "one was not seen yet";
}

TEST_F(AReception, DrawsForANewcomerAtOnceWhatIsLongAgo) {
  const auto first = client(Role::look);
  reception_.hear_text(first, k_wants_room);
  draw('a', 600ms);  // and then it rests for 4.2 s
  reception_.gone(first);
  std::this_thread::sleep_for(k_room_lasts + 100ms);
  const auto second = client(Role::look);
  reception_.hear_text(second, k_wants_room);
  EXPECT_EQ(shown_to(second), std::nullopt);
  draw('b', 0ms);
  EXPECT_EQ(shown_to(second), 'b');
}

TEST_F(AReception, GivesWhoComesBackFromTheWindowTheLastRoomImage) {
  const auto guest = client(Role::look);
  reception_.hear_text(guest, k_wants_room);
  draw('a', 200ms);
  reception_.hear_text(guest, R"({"type": "pictures", "room": false})");
  EXPECT_EQ(shown_to(guest), 'a');
  reception_.hear_text(guest, k_wants_room);
  EXPECT_EQ(shown_to(guest), 'a');
}

// It may have come when nothing was hidden any more.
TEST_F(AReception, GivesAnImageThatWasDrawnWhileTheRoomWasHiddenToNoLesserRole) {
  const auto works = client(Role::work), looks = client(Role::look);
  reception_.hide_room(Role::work, Clock::now() + 200ms);
  for (const auto& each : {works, looks}) reception_.hear_text(each, k_wants_room);
  draw('a', 300ms);
  EXPECT_EQ(shown_to(works), 'a');
  EXPECT_EQ(shown_to(looks), '}');
  const auto newcomer = client(Role::look);
  reception_.hear_text(newcomer, k_wants_room);
  EXPECT_EQ(shown_to(newcomer), '}');
  for (const auto& each : {works, looks, newcomer})
    reception_.hear_text(each, R"({"type": "seen", "picture": 1})");
  rest_to_the_end();
  draw('b', 0ms);
  for (const auto& each : {works, looks, newcomer}) EXPECT_EQ(shown_to(each), 'b');
}

TEST_F(AReception, ShowsALesserRoleNoRoomWhileItIsHidden) {
  const auto first = client(Role::look);
  reception_.hear_text(first, k_wants_room);
  draw('a', 200ms);
  reception_.hide_room(Role::work, Clock::now() + 1min);
  const auto second = client(Role::look), third = client(Role::work);
  for (const auto& each : {second, third}) reception_.hear_text(each, k_wants_room);
  EXPECT_EQ(shown_to(second), '}');
  EXPECT_EQ(shown_to(third), 'a');
}

}  // namespace
}  // namespace limn::remote
