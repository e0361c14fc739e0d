#include "remote/api/room_image_publisher.h"

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <thread>

#include "tests/support/matchers.h"

namespace limn::remote {
namespace {

using namespace std::chrono_literals;
using Clock = RoomImagePublisher::Clock;

// An image that takes long, for example because programs are linked for it, delays no later one.
TEST(RoomImagePublisher, RestsByTheTimeThatTwoImagesTook) {
  int drawn = 0;
  ImageCallback answer;
  ImageProviders providers;
  providers.draw_room = [&](ImageCallback given) {
    ++drawn;
    answer = std::move(given);
  };
  const auto client = std::make_shared<WsClient>();
  client->wake = [] {};
  const WsClients clients{client};
  RoomImagePublisher images(&clients, &providers, [](const std::function<void()>& job) { job(); });
  const auto draw_for = [&](Clock::duration time, std::uint8_t content) {
    std::this_thread::sleep_for(time);
    answer({"{}", {content}});
    images.mark_shown(client, client->room.last_sent.value());
  };
  const auto wait_for_drawing = [&](int number) {
    for (const auto begun = Clock::now(); drawn < number && Clock::now() - begun < 20s;) {
      std::this_thread::sleep_for(5ms);
      images.update_at(Clock::now());
    }
    ASSERT_EQ(drawn, number);
  };

  ASSERT_TRUE(images.subscribe(client, true));
  ASSERT_EQ(drawn, 1);
  draw_for(100ms, 1);
  EXPECT_EQ(drawn, 1) << "projectors come first";
  wait_for_drawing(2);
  const auto begun = Clock::now();
  draw_for(1s, 2);
  wait_for_drawing(3);
  EXPECT_LT(Clock::now() - begun, k_room_rest_factor * 500ms);
}

}  // namespace
}  // namespace limn::remote
