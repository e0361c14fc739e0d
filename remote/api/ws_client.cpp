#include "remote/api/ws_client.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/json_text.h"

namespace limn::remote {

void Outbox::add_answer(std::string text) {
  answers_.push_back(std::move(text));
  if (answers_.size() <= k_max_answers) return;
  answers_.clear();
  end("too many answers were not read");
}

void Outbox::set_image(ImageKind kind, std::shared_ptr<const std::string> bytes) {
  (kind == ImageKind::room ? room_ : window_) = std::move(bytes);
}

void Outbox::end(const std::string& why) {
  if (is_ending_) return;
  is_ending_ = true;
  const nlohmann::ordered_json bye = {{"type", "bye"}, {"why", why}};
  bye_ = std::make_shared<const std::string>(json_text(bye));
}

std::optional<Outgoing> Outbox::next_message() {
  if (bye_) return Outgoing{std::exchange(bye_, nullptr)};
  if (is_ending_) return std::nullopt;
  if (!answers_.empty()) {
    auto text = std::make_shared<const std::string>(std::move(answers_.front()));
    answers_.pop_front();
    return Outgoing{std::move(text)};
  }
  if (glasses_) return Outgoing{std::exchange(glasses_, nullptr)};
  if (parts_) return Outgoing{std::exchange(parts_, nullptr)};
  if (state_) return Outgoing{std::exchange(state_, nullptr)};
  if (window_) return Outgoing{std::exchange(window_, nullptr), false};
  if (room_) return Outgoing{std::exchange(room_, nullptr), false};
  return std::nullopt;
}

bool RateLimit::allows(Time now) {
  if (last_)
    left_ = std::min(at_once_, left_ + per_second_ * std::chrono::duration<double>(now - *last_).count());
  last_ = now;
  if (left_ < 1) return false;
  --left_;
  return true;
}

}  // namespace limn::remote
