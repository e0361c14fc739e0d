#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

#include "core/imager.h"

namespace limn::remote {

/// Where the cameras of the last images were that a page may still show, so that people can draw in them.
class ShownImages {
 public:
  /// Images that are remembered: some seconds of a window.
  static constexpr std::size_t k_most = 64;

  /// `over_prototype`: the camera with the prototype's frame for its world; nullopt: not known.
  void add(std::uint32_t number, const std::optional<Imager>& over_prototype) {
    if (!over_prototype) return;
    images_.emplace_back(number, *over_prototype);
    if (images_.size() > k_most) images_.pop_front();
  }
  /// The camera of an image; null when it is not known any more.
  const Imager* find(std::uint32_t number) const {
    for (auto image = images_.rbegin(); image != images_.rend(); ++image)
      if (image->first == number) return &image->second;
    return nullptr;
  }
  void clear() { images_.clear(); }

 private:
  std::deque<std::pair<std::uint32_t, Imager>> images_;
};

}  // namespace limn::remote
