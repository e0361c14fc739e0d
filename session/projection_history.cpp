#include "session/projection_history.h"

#include <algorithm>

namespace limn::session {
namespace {

constexpr std::size_t k_most = 30;  // about a second: longer than until a camera sees an image

}  // namespace

void ProjectionHistory::add(const std::vector<cv::Mat>& images, Stamp shown_at) {
  Shown shown;
  if (shown_.size() == k_most) {  // its memory is reused
    shown = std::move(shown_.front());
    shown_.pop_front();
  }
  shown.at = shown_at;
  shown.images.resize(images.size());
  for (std::size_t i = 0; i < images.size(); ++i) images[i].copyTo(shown.images[i]);
  shown_.push_back(std::move(shown));
}

const std::vector<cv::Mat>* ProjectionHistory::at(Stamp moment) const {
  const auto later =
      std::find_if(shown_.begin(), shown_.end(), [&](const Shown& s) { return s.at > moment; });
  return later == shown_.begin() ? nullptr : &std::prev(later)->images;
}

}  // namespace limn::session
