#include "session/key_client.h"

#include "core/log.h"

namespace limn::session {

KeyClient::KeyClient(std::vector<device::KeySource>& sources,
                     const scene::Scene& scene,
                     Keys* keys,
                     DeviceHealth* health)
    : own_(scene), keys_(keys ? keys : &own_), health_(health) {
  for (device::KeySource& source : sources)
    sources_.push_back({&source, health->add({source.name(), "keys"})});
}

void KeyClient::apply_edits(const SessionMoment& moment) {
  for (Source& source : sources_) {
    const auto pressed = source.keys->poll_pressed_keys();
    if (static_cast<bool>(pressed) == source.is_gone)  // the source failed, or works again
      pressed ? health_->works(source.number) : health_->fails(source.number, pressed.message());
    source.is_gone = !pressed;
    if (!pressed) continue;
    for (const int key : *pressed) edit(key, source, moment);
  }
}

void KeyClient::edit(int key, const Source& source, const SessionMoment& moment) {
  const auto edit = keys_->edit_of(key);
  const Status done = edit ? moment.session.edit(*edit, source.keys->name(), moment.at) : Status();
  if (done) return;
  moment.telemetry.note(moment.at, done.message());
  log_warning("live: {}", done.message());
}

}  // namespace limn::session
