#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

namespace limn::test {

/// Writes NIfTI and DICOM files byte by byte from their specifications, without the libraries that read them.

/// A NIfTI-1 header and its values; the members are those of the specification.
struct NiftiFile {
  std::array<std::int16_t, 8> dim = {3, 2, 2, 2, 1, 1, 1, 1};
  std::int16_t datatype = 4, bits = 16;  ///< int16
  std::array<float, 8> pixdim = {1, 1, 1, 1, 0, 0, 0, 0};
  float slope = 0, intercept = 0, cal_max = 0, cal_min = 0;
  char units = 2;  ///< mm
  std::int16_t qform_code = 0, sform_code = 1;
  std::array<float, 6> quatern = {0, 0, 0, 0, 0, 0};  ///< b, c, d, and the offset.
  std::array<std::array<float, 4>, 3> srow = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
  std::string magic = "n+1";
  bool is_big_endian = false;
  std::string values;  ///< In the file's order of bytes.

  std::string bytes() const {
    std::string out(352, '\0');
    put(&out, 0, std::int32_t{348});
    for (std::size_t i = 0; i < 8; ++i) put(&out, 40 + 2 * i, dim[i]);
    put(&out, 70, datatype);
    put(&out, 72, bits);
    for (std::size_t i = 0; i < 8; ++i) put(&out, 76 + 4 * i, pixdim[i]);
    put(&out, 108, 352.F);
    put(&out, 112, slope);
    put(&out, 116, intercept);
    out[123] = units;
    put(&out, 124, cal_max);
    put(&out, 128, cal_min);
    put(&out, 252, qform_code);
    put(&out, 254, sform_code);
    for (std::size_t i = 0; i < 6; ++i) put(&out, 256 + 4 * i, quatern[i]);
    for (std::size_t row = 0; row < 3; ++row)
      for (std::size_t column = 0; column < 4; ++column)
        put(&out, 280 + 16 * row + 4 * column, srow[row][column]);
    out.replace(344, magic.size(), magic);
    return out + values;
  }

  template <class Number>
  void put(std::string* to, std::size_t at, Number number) const {
    std::array<char, sizeof(Number)> raw{};
    std::memcpy(raw.data(), &number, sizeof number);
    for (std::size_t i = 0; i < raw.size(); ++i)
      (*to)[at + (is_big_endian ? raw.size() - 1 - i : i)] = raw[i];
  }
  template <class Number>
  void add_value(Number number) {
    values.resize(values.size() + sizeof number);
    put(&values, values.size() - sizeof number, number);
  }
};

/// A DICOM slice in explicit or implicit VR, little endian. The texts are as the file holds them.
struct DicomFile {
  std::string series = "1.2.3.4", description = "head", number = "5";
  std::string position = "0\\0\\0", orientation = "1\\0\\0\\0\\1\\0", spacing = "1\\1";
  std::string window_centre, window_width, slope = "1", intercept = "0";
  std::string photometric = "MONOCHROME2", frames;
  int columns = 2, rows = 2, allocated = 16, stored = 16, high = 15;
  bool is_signed = false, is_explicit = true;
  std::string transfer_syntax = {};  ///< Empty: by is_explicit.
  std::string pixels;                ///< Native, little endian; or one encoded fragment where `is_encoded`.
  bool is_encoded = false;
  /// Positions of the frames of an enhanced file, in which functional groups take the place of the members
  /// position, orientation, spacing, window and rescale; `pixels` are those of all frames.
  std::vector<std::string> frame_positions = {};
  std::vector<std::string> fragments = {};  ///< Encoded fragments instead of `pixels`.

  std::string bytes() const {
    std::string meta;
    const std::string syntax = !transfer_syntax.empty() ? transfer_syntax
                               : is_explicit            ? "1.2.840.10008.1.2.1"
                                                        : "1.2.840.10008.1.2";
    add(&meta, true, 0x0002, 0x0001, "OB", std::string("\0\1", 2));
    add(&meta, true, 0x0002, 0x0002, "UI", "1.2.840.10008.5.1.4.1.1.2");
    add(&meta, true, 0x0002, 0x0003, "UI", "1.2.3");
    add(&meta, true, 0x0002, 0x0010, "UI", syntax);
    std::string length;
    add(&length, true, 0x0002, 0x0000, "UL", number32(static_cast<std::uint32_t>(meta.size())));
    std::string data;
    const auto put = [&](int group, int element, const char* vr, const std::string& value) {
      if (!value.empty()) add(&data, is_explicit, group, element, vr, value);
    };
    put(0x0008, 0x0016, "UI", "1.2.840.10008.5.1.4.1.1.2");
    put(0x0008, 0x103e, "LO", description);
    put(0x0020, 0x000e, "UI", series);
    put(0x0020, 0x0011, "IS", number);
    const bool is_enhanced = !frame_positions.empty();
    const auto put_beside = [&](int group, int element, const std::string& value) {
      if (!is_enhanced) put(group, element, "DS", value);
    };
    put_beside(0x0020, 0x0032, position);
    put_beside(0x0020, 0x0037, orientation);
    put(0x0028, 0x0002, "US", number16(photometric == "RGB" ? 3 : 1));
    put(0x0028, 0x0004, "CS", photometric);
    put(0x0028, 0x0008, "IS", is_enhanced ? std::to_string(frame_positions.size()) : frames);
    put(0x0028, 0x0010, "US", number16(rows));
    put(0x0028, 0x0011, "US", number16(columns));
    put_beside(0x0028, 0x0030, spacing);
    put(0x0028, 0x0100, "US", number16(allocated));
    put(0x0028, 0x0101, "US", number16(stored));
    put(0x0028, 0x0102, "US", number16(high));
    put(0x0028, 0x0103, "US", number16(is_signed ? 1 : 0));
    put_beside(0x0028, 0x1050, window_centre);
    put_beside(0x0028, 0x1051, window_width);
    put_beside(0x0028, 0x1052, intercept);
    put_beside(0x0028, 0x1053, slope);
    if (is_enhanced) data += functional_groups();
    if (is_encoded) {
      data +=
          number16(0x7fe0) + number16(0x0010) + "OB" + number16(0) + number32(0xffffffff) + item(0xe000, "");
      for (const std::string& each : fragments.empty() ? std::vector{pixels} : fragments)
        data += item(0xe000, each);
      data += number16(0xfffe) + number16(0xe0dd) + number32(0);
    } else
      put(0x7fe0, 0x0010, allocated == 8 && is_explicit ? "OB" : "OW", pixels);
    std::string file(128, '\0');
    file.append("DICM").append(length).append(meta).append(data);
    return file;
  }

  void add_value(int value) {
    pixels += allocated == 8 ? std::string(1, static_cast<char>(value)) : number16(value);
  }

  static std::string number16(int value) {
    return {static_cast<char>(value & 0xff), static_cast<char>(value >> 8 & 0xff)};
  }
  static std::string number32(std::uint32_t value) {
    return number16(static_cast<int>(value & 0xffff)) + number16(static_cast<int>(value >> 16));
  }

 private:
  // A sequence of items.
  std::string sequence(int group, int element, const std::vector<std::string>& items) const {
    std::string value, out;
    for (const std::string& each : items) value += item(0xe000, each);
    add(&out, is_explicit, group, element, "SQ", value);
    return out;
  }
  std::string functional_groups() const {
    const auto texts = [&](const std::vector<std::pair<std::array<int, 2>, std::string>>& elements) {
      std::string out;
      for (const auto& [tag, value] : elements)
        if (!value.empty()) add(&out, is_explicit, tag[0], tag[1], "DS", value);
      return out;
    };
    const std::string shared =
        sequence(0x0020, 0x9116, {texts({{{0x0020, 0x0037}, orientation}})}) +
        sequence(0x0028, 0x9110, {texts({{{0x0028, 0x0030}, spacing}})}) +
        sequence(0x0028, 0x9132,
                 {texts({{{0x0028, 0x1050}, window_centre}, {{0x0028, 0x1051}, window_width}})}) +
        sequence(0x0028, 0x9145, {texts({{{0x0028, 0x1052}, intercept}, {{0x0028, 0x1053}, slope}})});
    std::vector<std::string> of_frames;
    for (const std::string& each : frame_positions)
      of_frames.push_back(sequence(0x0020, 0x9113, {texts({{{0x0020, 0x0032}, each}})}));
    return sequence(0x5200, 0x9229, {shared}) + sequence(0x5200, 0x9230, of_frames);
  }

  static std::string even(std::string value, char fill) {
    if (value.size() % 2 == 1) value += fill;
    return value;
  }
  static std::string item(int element, const std::string& value) {
    const std::string padded = even(value, '\0');
    return number16(0xfffe) + number16(element) + number32(static_cast<std::uint32_t>(padded.size())) +
           padded;
  }
  static void add(
      std::string* to, bool is_explicit, int group, int element, const std::string& vr, std::string value) {
    value = even(std::move(value), vr == "UI" || vr == "OB" ? '\0' : ' ');
    *to += number16(group) + number16(element);
    if (!is_explicit)
      *to += number32(static_cast<std::uint32_t>(value.size()));
    else if (vr == "OB" || vr == "OW" || vr == "SQ")
      *to += vr + number16(0) + number32(static_cast<std::uint32_t>(value.size()));
    else
      *to += vr + number16(static_cast<int>(value.size()));
    *to += value;
  }
};

}  // namespace limn::test
