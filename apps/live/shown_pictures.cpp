#include "apps/live/shown_pictures.h"

#include <algorithm>

namespace limn::apps {
namespace {

constexpr std::size_t k_most = 30;  // between paint and their light in a frame: a second's

}  // namespace

void ShownPictures::add(const std::vector<cv::Mat>& pictures, Stamp shown_at) {
  Shown shown;
  if (shown_.size() == k_most) {  // its memory serves again
    shown = std::move(shown_.front());
    shown_.pop_front();
  }
  shown.at = shown_at;
  shown.pictures.resize(pictures.size());
  for (std::size_t i = 0; i < pictures.size(); ++i) pictures[i].copyTo(shown.pictures[i]);
  shown_.push_back(std::move(shown));
}

const std::vector<cv::Mat>* ShownPictures::at(Stamp moment) const {
  const auto later =
      std::find_if(shown_.begin(), shown_.end(), [&](const Shown& s) { return s.at > moment; });
  return later == shown_.begin() ? nullptr : &std::prev(later)->pictures;
}

}  // namespace limn::apps
