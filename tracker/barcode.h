#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace limn::tracker {

/// A family of ARToolKit 5's matrix codes (`AR_MATRIX_CODE_3x3` and so on). The black border is a quarter of
/// the side wide; the inner half of the square holds cells x cells cells. When the marker is upright, its
/// top-left and bottom-left cells are black and its bottom-right cell is white. The other cells, row by row
/// from the top left, are the word's bits, highest first; 1 is BLACK. Source: get_matrix_code in ARToolKit5's
/// lib/SRC/AR/arPattGetID.c.
struct Barcode {
  std::string_view name;  ///< `artoolkit_3x3`
  int cells = 0;
  /// The word of an id is the exclusive or of the rows that belong to the id's set bits, lowest bit first: id
  /// 5 is row 0 xor row 2.
  std::vector<std::uint32_t> rows;

  std::size_t ids() const { return std::size_t{1} << rows.size(); }
};

/// `artoolkit_3x3` (64 ids), `artoolkit_3x3_parity65` (32), `artoolkit_3x3_hamming63` (8), `artoolkit_4x4`
/// (8192), `artoolkit_4x4_bch_13_9_3` (512), `artoolkit_4x4_bch_13_5_5` (32), `artoolkit_5x5_bch_22_12_5`
/// (4096), `artoolkit_5x5_bch_22_7_7` (128).
std::span<const Barcode> barcodes();

/// The family with that name; null when there is none.
const Barcode* find_barcode(std::string_view name);

/// The word of an id, before it is laid out as cells. As in ARToolKit, 1 is black.
std::uint32_t barcode_word(const Barcode& barcode, std::size_t id);

/// All cells of the upright marker, row by row, first bit highest. As in CodeFamily::codes, 1 is white.
std::uint64_t barcode_cells(const Barcode& barcode, std::size_t id);

}  // namespace limn::tracker
