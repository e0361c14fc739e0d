#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::validate {

/// A row of the demo's table: what was measured, the value, the limit.
struct DemoRow {
  std::string what;
  std::string value;
  std::string limit;  ///< Empty: no limit.
  bool good = true;
};

struct DemoImage {
  std::string file;  ///< Name in the output folder, without .png.
  std::string title;
  std::string caption;
  cv::Mat image;  ///< 8-bit BGR or grey.
};

/// The content of the demo's page.
struct DemoPage {
  std::string headline;
  std::vector<DemoRow> rows;
  std::vector<DemoImage> images;
};

/// Writes one HTML file that needs no other: images are embedded, scaled to at most 1280 pixels across.
Status write_demo_page(const DemoPage& page, const std::filesystem::path& path);

/// The rows as a table for a terminal.
std::string text_table(const std::vector<DemoRow>& rows);

}  // namespace limn::validate
