#include "nodes/dds/neighbourhood.h"

#include <algorithm>
#include <array>
#include <vector>

namespace limn::nodes {
namespace {

constexpr std::size_t k_most = 256;  // programs

std::vector<dds_instance_handle_t> matched_writers(dds_entity_t reader) {
  std::vector<dds_instance_handle_t> out(k_most);
  const dds_return_t count = dds_get_matched_publications(reader, out.data(), k_most);
  out.resize(std::min(k_most, static_cast<std::size_t>(std::max(count, 0))));
  return out;
}

}  // namespace

dds_return_t Neighbourhood::open(dds_entity_t participant, dds_entity_t offers) {
  offers_ = offers;
  participants_ = dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, nullptr);
  return participants_ < 0 ? participants_ : dds_get_instance_handle(participant, &self_);
}

void Neighbourhood::note_offer(dds_instance_handle_t writer) {
  const std::lock_guard lock(mutex_);
  met_[writer] = now();
}

std::set<dds_instance_handle_t> Neighbourhood::found_participants() const {
  std::array<void*, k_most> samples{};
  std::array<dds_sample_info_t, k_most> infos{};
  const dds_return_t count = dds_read(participants_, samples.data(), infos.data(), k_most, k_most);
  std::set<dds_instance_handle_t> out;
  for (std::size_t i = 0; i < static_cast<std::size_t>(std::max(count, 0)); ++i)
    if (infos[i].instance_state == DDS_IST_ALIVE && infos[i].instance_handle != self_)
      out.insert(infos[i].instance_handle);
  if (count > 0) dds_return_loan(participants_, samples.data(), count);
  return out;
}

std::set<dds_instance_handle_t> Neighbourhood::connected_participants() const {
  std::set<dds_instance_handle_t> out;
  for (const dds_instance_handle_t writer : matched_writers(offers_)) {
    dds_builtintopic_endpoint_t* endpoint = dds_get_matched_publication_data(offers_, writer);
    if (!endpoint) continue;
    out.insert(endpoint->participant_instance_handle);
    dds_builtintopic_free_endpoint(endpoint);
  }
  return out;
}

NeighbourState Neighbourhood::state() {
  constexpr double k_longest_entry_s =
      5;  // a program with keys is connected by then, even if datagrams are lost
  const std::vector<dds_instance_handle_t> writers = matched_writers(offers_);
  std::set<dds_instance_handle_t> unknown = found_participants(), entered = connected_participants();
  const Stamp at = now();
  const auto since = [at](const auto& before, dds_instance_handle_t handle) {
    const auto found = before.find(handle);
    return found == before.end() ? at : found->second;
  };
  const std::lock_guard lock(mutex_);
  // One that was connected and left is remembered for a while, and is no stranger.
  for (const dds_instance_handle_t participant : entered_)
    if (unknown.contains(participant)) entered.insert(participant);
  for (const dds_instance_handle_t participant : entered) unknown.erase(participant);
  entered_ = std::move(entered);
  NeighbourState out;
  std::map<dds_instance_handle_t, Stamp> met, strangers;
  for (const dds_instance_handle_t writer : writers) {
    met[writer] = since(met_, writer);
    out.longest_silence_s = std::max(out.longest_silence_s, seconds_between(met[writer], at));
  }
  for (const dds_instance_handle_t stranger : unknown) {
    strangers[stranger] = since(strangers_, stranger);
    if (seconds_between(strangers[stranger], at) > k_longest_entry_s) ++out.strangers;
  }
  met_ = std::move(met);
  strangers_ = std::move(strangers);
  return out;
}

}  // namespace limn::nodes
