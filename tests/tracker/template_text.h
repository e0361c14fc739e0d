#pragma once

#include <fmt/core.h>

#include <string>

namespace limn::tracker {

/// An ARToolKit template's file, `size` cells a side.
inline std::string template_text(int size) {
  // An L with a dot, which differs from all of its rotations.
  const auto grey = [&](int row, int column) {
    const bool stem = column > size / 5 && column < size / 2 && row > size / 8;
    const bool foot = row > size * 3 / 4 && column > size / 5 && column < size * 7 / 8;
    const bool dot = row < size / 3 && column > size * 3 / 4;
    return stem || foot || dot ? 20 : 235;
  };
  std::string text;
  for (int turn = 0; turn < 4; ++turn)
    for (int colour = 0; colour < 3; ++colour)
      for (int row = 0; row < size; ++row) {
        for (int column = 0; column < size; ++column) {
          int r = row;
          int c = column;
          for (int k = 0; k < turn; ++k) {
            const int before = r;
            r = size - 1 - c;
            c = before;
          }
          text += fmt::format(" {:3d}", grey(r, c));
        }
        text += "\n";
      }
  return text;
}

}  // namespace limn::tracker
