#include "tracker/barcode.h"

#include <algorithm>
#include <bit>

#include "core/names.h"

namespace limn::tracker {
namespace {

using Rows = std::vector<std::uint32_t>;

Rows plain_rows(int bits) {
  Rows rows;
  for (int i = 0; i < bits; ++i) rows.push_back(1u << i);
  return rows;
}

// The data bits, with even parity in the highest bit.
Rows parity_rows(int bits) {
  Rows rows = plain_rows(bits);
  for (std::uint32_t& row : rows) row |= 1u << bits;
  return rows;
}

// The systematic cyclic code of a generator polynomial (highest power first): the id's bits, then the
// remainder of their division by the polynomial.
Rows cyclic_rows(int bits, std::uint32_t generator) {
  const int checks = static_cast<int>(std::bit_width(generator)) - 1;
  Rows rows;
  for (int i = 0; i < bits; ++i) {
    const std::uint32_t data = 1u << (i + checks);
    std::uint32_t remainder = data;
    for (int power = i + checks; power >= checks; --power)
      if ((remainder >> power) & 1) remainder ^= generator << (power - checks);
    rows.push_back(data | remainder);
  }
  return rows;
}

// The BCH generators are in octal, from Lin and Costello, "Error Control Coding", table 6.4: (15,11), (15,7),
// (31,21), (31,16), shortened.
std::vector<Barcode> all_barcodes() {
  return {{"artoolkit_3x3", 3, plain_rows(6)},
          {"artoolkit_3x3_parity65", 3, parity_rows(5)},
          {"artoolkit_3x3_hamming63", 3, {0b000111, 0b011001, 0b101010}},
          {"artoolkit_4x4", 4, plain_rows(13)},
          {"artoolkit_4x4_bch_13_9_3", 4, cyclic_rows(9, 023)},
          {"artoolkit_4x4_bch_13_5_5", 4, cyclic_rows(5, 0721)},
          {"artoolkit_5x5_bch_22_12_5", 5, cyclic_rows(12, 03551)},
          {"artoolkit_5x5_bch_22_7_7", 5, cyclic_rows(7, 0107657)}};
}

}  // namespace

std::span<const Barcode> barcodes() {
  static const std::vector<Barcode> all = all_barcodes();
  return all;
}

const Barcode* find_barcode(std::string_view name) {
  const auto all = barcodes();
  return find_named(all, name);
}

std::uint32_t barcode_word(const Barcode& barcode, std::size_t id) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < barcode.rows.size(); ++i)
    if ((id >> i) & 1) word ^= barcode.rows[i];
  return word;
}

std::uint64_t barcode_cells(const Barcode& barcode, std::size_t id) {
  const std::uint32_t word = barcode_word(barcode, id);
  const int last = barcode.cells - 1;
  int bit = barcode.cells * barcode.cells - 3;
  std::uint64_t cells = 0;
  for (int row = 0; row <= last; ++row)
    for (int column = 0; column <= last; ++column) {
      const bool left_corner = column == 0 && (row == 0 || row == last);
      const bool white_corner = column == last && row == last;
      const bool white = white_corner || (!left_corner && !((word >> --bit) & 1));
      cells = (cells << 1) | std::uint64_t{white};
    }
  return cells;
}

}  // namespace limn::tracker
