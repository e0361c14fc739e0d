#include "session/contact_sheet.h"

#include <opencv2/imgproc.hpp>
#include <string>

#include "core/file.h"
#include "core/html.h"
#include "core/image_io.h"
#include "core/names.h"

namespace limn::apps {
namespace {

constexpr int k_width = 960;  // largest width of an image, pixels

constexpr const char* k_sheet_style = R"(
body { margin: 0 auto; max-width: 1320px; padding: 2rem 1.5rem 4rem; background: #14161a; color: #e8e6e1;
       font: 16px/1.5 system-ui, sans-serif; }
h1 { font-weight: 600; } .looks { display: grid; grid-template-columns: repeat(auto-fill, minmax(26rem, 1fr)); gap: 1.6rem; }
figure { margin: 0; break-inside: avoid; } img { width: 100%; display: block; border-radius: 4px; background: #000; }
figcaption { margin-top: .5rem; color: #a9a69f; } figcaption b { color: #e8e6e1; display: block; }
@media print { body { background: #fff; color: #000; } figcaption, figcaption b { color: #000; } }
)";

std::string image_html(const std::filesystem::path& file, const std::string& name) {
  auto image = read_image(file);
  if (!image) return "";
  if (image->cols > k_width)
    cv::resize(*image, *image, {k_width, image->rows * k_width / image->cols}, 0, 0, cv::INTER_AREA);
  return fmt::format("<img src=\"{}\" alt=\"{}\">", data_uri(*image), escaped(name));
}

}  // namespace

Status write_contact_sheet(std::span<const scene::Look> looks,
                           const std::filesystem::path& folder,
                           const std::filesystem::path& page) {
  std::string html = fmt::format(
      "<!doctype html><html lang=\"en\"><meta "
      "charset=\"utf-8\"><title>Looks</title><style>{}</style><h1>Looks</h1>"
      "<div class=\"looks\">\n",
      k_sheet_style);
  for (const scene::Look& look : looks) {
    std::vector<std::string> parts;
    for (const scene::Look::Part& part : look.parts)
      parts.push_back(fmt::format("{}: {}", escaped(part.slot), escaped(part.variant)));
    html += fmt::format("<figure>{}<figcaption><b>{}</b>{}</figcaption></figure>\n",
                        image_html(folder / (look.name + ".png"), look.name), escaped(look.name),
                        joined_names(parts, ""));
  }
  return write_file(page, html + "</div></html>\n");
}

}  // namespace limn::apps
