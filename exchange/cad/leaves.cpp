#include "exchange/cad/leaves.h"

#include <fmt/ranges.h>

#include <opencascade/TDF_Tool.hxx>
#include <opencascade/TDataStd_Name.hxx>
#include <opencascade/XCAFDoc_ColorTool.hxx>
#include <opencascade/XCAFDoc_DocumentTool.hxx>
#include <opencascade/XCAFPrs_DocumentExplorer.hxx>

#include "core/utf8.h"

namespace limn::cad {
namespace {

constexpr std::size_t k_most_leaves = 200000;
constexpr float k_no_colour = 0.6F;  // as meshes that state none

std::string name_of(const TDF_Label& label) {
  Handle(TDataStd_Name) name;
  if (label.IsNull() || !label.FindAttribute(TDataStd_Name::GetID(), name)) return "";
  const TCollection_ExtendedString& wide = name->Get();
  std::string text(static_cast<std::size_t>(wide.LengthOfCString()) + 1, '\0');
  char* begin = text.data();
  wide.ToUTF8CString(begin);
  text.resize(text.find('\0'));
  return as_utf8(text);
}

// The colour that an instance states for itself.
std::optional<Colour> own_colour(const Handle(XCAFDoc_ColorTool) & colours, const TDF_Label& instance) {
  Quantity_ColorRGBA colour;
  for (const XCAFDoc_ColorType type : {XCAFDoc_ColorSurf, XCAFDoc_ColorGen}) {
    if (!colours->GetColor(instance, type, colour)) continue;
    XCAFPrs_Style style;
    style.SetColorSurf(colour);
    return colour_of(style);
  }
  return std::nullopt;
}

}  // namespace

Colour colour_of(const XCAFPrs_Style& style) {
  if (!style.IsSetColorSurf()) return {k_no_colour, k_no_colour, k_no_colour, 1};
  const Quantity_ColorRGBA& stated = style.GetColorSurfRGBA();  // linear
  const Quantity_Color& rgb = stated.GetRGB();
  return {static_cast<float>(rgb.Red()), static_cast<float>(rgb.Green()), static_cast<float>(rgb.Blue()),
          stated.Alpha()};
}

Result<Leaves> leaves_of(const Handle(TDocStd_Document) & document, const std::filesystem::path& path) {
  Leaves leaves;
  const Handle(XCAFDoc_ColorTool) colours = XCAFDoc_DocumentTool::ColorTool(document->Main());
  for (XCAFPrs_DocumentExplorer at(document, XCAFPrs_DocumentExplorerFlags_OnlyLeafNodes); at.More();
       at.Next()) {
    const XCAFPrs_DocumentNode& node = at.Current();
    if (!node.Style.IsVisible()) {
      ++leaves.hidden;
      continue;
    }
    Leaf leaf{.product = node.RefLabel, .name = name_of(node.RefLabel)};
    if (leaf.name.empty()) leaf.name = name_of(node.Label);
    for (int depth = 0; depth < at.CurrentDepth(); ++depth)
      leaf.path.push_back(name_of(at.Current(depth).RefLabel));
    // Some files have a nameless product for the shape inside a named one.
    while (leaf.name.empty() && !leaf.path.empty()) {
      leaf.name = leaf.path.back();
      leaf.path.pop_back();
    }
    leaf.placed = node.Location.Transformation();
    leaf.style = node.Style;
    if (node.Label != node.RefLabel) leaf.whole = own_colour(colours, node.Label);
    TCollection_AsciiString entry;
    TDF_Tool::Entry(node.RefLabel, entry);
    leaf.key = entry.ToCString();
    const Colour colour = leaf.whole ? *leaf.whole : colour_of(leaf.style);
    leaf.key += fmt::format("{}{}", leaf.whole.has_value(), fmt::join(colour, " "));
    leaves.all.push_back(std::move(leaf));
    if (leaves.all.size() > k_most_leaves)
      return error(
          "{}: expected at most {} placed parts, found more in assemblies within assemblies. Export a part "
          "of the assembly.",
          path.string(), k_most_leaves);
  }
  return leaves;
}

}  // namespace limn::cad
