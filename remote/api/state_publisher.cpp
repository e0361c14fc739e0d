#include "remote/api/state_publisher.h"

#include <nlohmann/json.hpp>

#include "core/json_text.h"
#include "remote/api/responses.h"

namespace limn::remote {
namespace {

using nlohmann::ordered_json;

// The state without its number.
ordered_json numberless_state(const SessionState& session,
                              const WsClients& clients,
                              std::span<const scene::Comment> comments) {
  ordered_json state = to_json(session);
  if (session.last_edit)
    state["last_edit"] = {{"who", session.last_edit->source},
                          {"action", session.last_edit->edit.action},
                          {"slot", session.last_edit->edit.slot},
                          {"value", session.last_edit->edit.value}};
  state["guests"] = ordered_json::array();
  for (const auto& client : clients) {
    ordered_json guest = {{"name", client->guest.name}, {"role", name_of(client->guest.role)}};
    if (client->glasses) guest["glasses"] = k_glasses_states.text(client->glasses->registration.state());
    state["guests"].push_back(std::move(guest));
  }
  state["comments"] = ordered_json::array();
  for (const scene::Comment& comment : comments)
    state["comments"].push_back({{"at", comment.at},
                                 {"who", comment.who},
                                 {"look", comment.look},
                                 {"slot", comment.slot},
                                 {"text", comment.text}});
  return state;
}

}  // namespace

void StatePublisher::set_update(SessionUpdate update) {
  if (update_) update.state = without_jitter(std::move(update.state), update_->state);
  update_ = std::move(update);
}

void StatePublisher::publish(std::span<const scene::Comment> comments) {
  if (!update_) return;
  ordered_json state = numberless_state(update_->state, *clients_, comments);
  const auto& edited = update_->state.last_edit;
  const bool is_edited = edited && edited->count != edit_count_;
  std::string text = json_text(state);
  if (text == published_ && !is_edited) return;
  published_ = std::move(text);
  ++number_;
  if (is_edited) {
    edit_count_ = edited->count;
    edit_number_ = number_;
  }
  if (edited) state["last_edit"]["number"] = edit_number_;
  ordered_json message = {{"type", "state"}, {"number", number_}};
  message.update(state);
  message_ = std::make_shared<const std::string>(json_text(message));
  for (const auto& client : *clients_) {
    client->outbox.set_state(message_);
    client->wake();
  }
}

}  // namespace limn::remote
