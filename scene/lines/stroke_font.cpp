#include "scene/lines/stroke_font.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <string_view>

namespace limn::scene {
namespace {

constexpr double k_units = 6;    // the height of a capital in the glyphs' grid
constexpr double k_advance = 6;  // from glyph to glyph, which are 4 wide

// Polylines, separated by blanks; two digits for each point: x from 0 to 4, y from 0 to 6.
const std::map<std::string_view, std::string_view>& glyphs() {
  static const std::map<std::string_view, std::string_view> all = {
      {"A", "002640 1232"},
      {"B", "00063645443303 3342413000"},
      {"C", "4536160501103041"},
      {"D", "00062644422000"},
      {"E", "46060040 0333"},
      {"F", "460600 0333"},
      {"G", "45361605011030414323"},
      {"H", "0006 4046 0343"},
      {"I", "2026 1636 1030"},
      {"J", "4641301001"},
      {"K", "0006 460340"},
      {"L", "060040"},
      {"M", "0006234640"},
      {"N", "00064046"},
      {"O", "100105163645413010"},
      {"P", "00063645443303"},
      {"Q", "100105163645413010 2240"},
      {"R", "00063645443303 2340"},
      {"S", "453616050413334241301001"},
      {"T", "0646 2620"},
      {"U", "060110304146"},
      {"V", "062046"},
      {"W", "0610233046"},
      {"X", "0046 0640"},
      {"Y", "062346 2320"},
      {"Z", "06460040"},
      {"0", "100105163645413010"},
      {"1", "152620 1030"},
      {"2", "05163645440040"},
      {"3", "05163645443323 334241301001"},
      {"4", "30360242"},
      {"5", "460603334241301001"},
      {"6", "4536160501103041423303"},
      {"7", "064610"},
      {"8", "13040516364544331302011030414233"},
      {"9", "4313040516364541301001"},
      {".", "2021"},
      {",", "2110"},
      {":", "2122 2425"},
      {"-", "1333"},
      {"+", "1333 2224"},
      {"/", "0046"},
      {"=", "0242 0444"},
      {"(", "36252130"},
      {")", "16252110"},
      {"%", "0046 0516 3041"},
      {"_", "0040"},
      {"'", "2625"},
      {"\"", "1615 3635"},
      {"!", "2622 2120"},
      {"?", "05163645442322 2120"},
      {"\xc2\xb0", "1526352415"},               // degree
      {"\xc3\x98", "100105163645413010 0046"},  // diameter
      {"\xc2\xb1", "2325 1434 1131"},           // plus or minus
      {" ", ""}};
  return all;
}

// The bytes of the first character, in capitals.
std::string first_character(std::string_view text) {
  const auto byte = static_cast<unsigned char>(text.front());
  const std::size_t length = byte >= 0xf0 ? 4 : byte >= 0xe0 ? 3 : byte >= 0xc0 ? 2 : 1;
  if (length > 1) return std::string(text.substr(0, length));
  return std::string(1, static_cast<char>(std::toupper(byte)));
}

}  // namespace

StrokeText stroke_text(const std::string& text, std::string* unknown) {
  StrokeText out;
  double x = 0;
  for (std::string_view rest = text; !rest.empty();) {
    const std::string character = first_character(rest);
    rest.remove_prefix(std::min(rest.size(), character.size()));
    const auto glyph = glyphs().find(character);
    if (glyph == glyphs().end()) {
      if (unknown != nullptr) *unknown += character;
      continue;
    }
    bool is_new = true;
    for (std::size_t i = 0; i < glyph->second.size();) {
      if (glyph->second[i] == ' ') {
        is_new = true;
        ++i;
        continue;
      }
      if (is_new) out.strokes.emplace_back();
      is_new = false;
      out.strokes.back().emplace_back((x + glyph->second[i] - '0') / k_units,
                                      (glyph->second[i + 1] - '0') / k_units);
      i += 2;
    }
    x += k_advance;
  }
  out.width = std::max(0.0, x - (k_advance - 4)) / k_units;
  return out;
}

}  // namespace limn::scene
