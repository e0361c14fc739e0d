#include "device/gui/qr_code.h"

#include <qrencode.h>

#include <memory>
#include <opencv2/core.hpp>

namespace limn::gui {
namespace {

constexpr int k_margin = 4;

struct FreeCode {
  void operator()(QRcode* code) const { QRcode_free(code); }
};

}  // namespace

cv::Mat qr_code(const std::string& text) {
  const std::unique_ptr<QRcode, FreeCode> code(QRcode_encodeString8bit(text.c_str(), 0, QR_ECLEVEL_M));
  if (!code) return {};
  cv::Mat out(code->width + 2 * k_margin, code->width + 2 * k_margin, CV_8UC1, cv::Scalar(255));
  for (int row = 0; row < code->width; ++row)
    for (int column = 0; column < code->width; ++column)
      if (code->data[row * code->width + column] & 1)
        out.at<std::uint8_t>(row + k_margin, column + k_margin) = 0;
  return out;
}

}  // namespace limn::gui
