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

// The first image takes long, for example because programs are linked for it. Later ones rest by their own
// time.
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

  ASSERT_TRUE(images.subscribe(client, true));
  ASSERT_EQ(drawn, 1);
  draw_for(500ms, 1);
  EXPECT_EQ(drawn, 2) << "the next one at once";
  draw_for(250ms, 2);
  EXPECT_EQ(drawn, 2) << "projectors come first";
  images.update_at(Clock::now() + k_room_rest_factor * 250ms);
  EXPECT_EQ(drawn, 3);
}

}  // namespace
}  // namespace limn::remote
