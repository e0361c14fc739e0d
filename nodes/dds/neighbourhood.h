#pragma once

#include <dds/dds.h>

#include <map>
#include <mutex>
#include <set>

#include "core/frame.h"
#include "nodes/engine.h"

namespace limn::nodes {

/// Which other programs the engine has found on the network, and when it met them last.
class Neighbourhood {
 public:
  /// Observes the participants that `participant` finds. `offers` is the reader of offers. Not 0: the
  /// engine's error.
  dds_return_t open(dds_entity_t participant, dds_entity_t offers);

  /// An offer has come from this writer.
  void note_offer(dds_instance_handle_t writer);
  /// The state now; to be called about once a second.
  NeighbourState state();

 private:
  std::set<dds_instance_handle_t> found_participants() const;
  std::set<dds_instance_handle_t> connected_participants() const;

  dds_entity_t participants_ = 0, offers_ = 0;
  dds_instance_handle_t self_ = 0;
  std::mutex mutex_;
  std::map<dds_instance_handle_t, Stamp> met_;        // when each connected writer of offers wrote last
  std::map<dds_instance_handle_t, Stamp> strangers_;  // participants that are not connected, since when
  std::set<dds_instance_handle_t> entered_;           // programs that were connected since they were found
};

}  // namespace limn::nodes
