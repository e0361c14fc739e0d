#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// The type of a PLY property's values.
struct PlyType {
  int size = 0;  ///< Bytes in a binary file; 0: no type of PLY.
  bool real = false, sign = false;
};

struct PlyProperty {
  std::string name;
  PlyType type;
  PlyType count_type;  ///< Its size is more than 0: the property is a list.
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

enum class PlyFormat { ascii, little_endian, big_endian };

/// The header of a PLY file.
struct PlyHeader {
  PlyFormat format = PlyFormat::ascii;
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  ///< Without the word "comment".
  std::size_t bytes = 0;              ///< Length of the header; the values begin there.
};

/// Reads the header. Lines may end in LF, CR LF or CR. Errors: no header, a line that is not part of PLY,
/// more elements than the file has bytes.
Result<PlyHeader> read_ply_header(const std::string& bytes, const std::string& where);

/// Reads a PLY file's values one by one, in any format.
class PlyValues {
 public:
  /// `bytes` is the whole file and must outlive this.
  PlyValues(const std::string& bytes, const PlyHeader& header);

  double next(const PlyType& type) { return ascii_ ? next_word() : next_binary(type); }
  /// Whether the file ended too early or held no number.
  bool failed() const { return failed_; }

 private:
  double next_word();
  double next_binary(const PlyType& type);

  const std::string& bytes_;
  std::size_t at_;
  bool ascii_, swapped_, failed_ = false;
};

}  // namespace limn::scene
