#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace limn::gui {

/// A QR code (ISO 18004, error correction M) of a text: 8-bit grey, one pixel for each module, black on
/// white, with the margin of four modules that readers need. Empty if the text is too long (over 2300 bytes).
cv::Mat qr_code(const std::string& text);

}  // namespace limn::gui
