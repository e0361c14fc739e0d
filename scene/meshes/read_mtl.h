#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// Reads the materials of an MTL file: Kd, map_Kd with its options (-s and -o move the texture), Pr and Pm.
/// Textures are searched beside the MTL file first. A line that cannot be read is a warning that names it.
/// Error: the file cannot be read.
Result<std::vector<MaterialSource>> read_mtl(const std::filesystem::path& path,
                                             std::vector<std::string>* warnings);

/// One line of OBJ or MTL: its number in the file, its first word and the rest without blanks at the ends.
struct ObjLine {
  std::size_t number = 0;
  std::string word, rest;
};

/// The lines of a text in OBJ's form. Lines may end in LF, CR LF or CR, and go on after a backslash. Empty
/// lines and comments are left out.
std::vector<ObjLine> obj_lines(const std::string& text);

/// The words of a text, without comments behind them.
std::vector<std::string> words_of(const std::string& text);

/// A whole word as a number; nullopt: it is none.
std::optional<double> number_of_word(const std::string& word);

}  // namespace limn::scene
