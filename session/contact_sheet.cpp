#include "session/contact_sheet.h"

#include <fmt/format.h>

#include <string>

#include "core/file.h"
#include "core/html.h"
#include "core/image_io.h"
#include "core/names.h"

namespace limn::session {
namespace {

constexpr int k_sheet_width = 960;  // largest width of an image, pixels

constexpr const char* k_sheet_style = R"(
.looks { display: grid; grid-template-columns: repeat(auto-fill, minmax(26rem, 1fr)); gap: 1.6rem; margin-top: 1rem; }
figure { break-inside: avoid; } figcaption b { display: block; }
@media print { body { background: #fff; color: #000; } figcaption, figcaption b { color: #000; } }
)";

std::string image_html(const std::filesystem::path& file, const std::string& name) {
  const auto image = read_image(file);
  return image ? html_image(*image, k_sheet_width, name) : "";
}

}  // namespace

Status write_contact_sheet(std::span<const scene::Look> looks,
                           const std::filesystem::path& folder,
                           const std::filesystem::path& page) {
  std::string html = "<h1>Looks</h1>\n<div class=\"looks\">\n";
  for (const scene::Look& look : looks) {
    std::vector<std::string> parts;
    for (const scene::Look::Part& part : look.parts)
      parts.push_back(fmt::format("{}: {}", part.slot, part.variant));
    html +=
        html_figure(image_html(folder / (look.name + ".png"), look.name), look.name, joined_names(parts, ""));
  }
  return write_file(page, html_page("Limn: looks", HtmlColours::dark, k_sheet_style, html + "</div>\n"));
}

}  // namespace limn::session
