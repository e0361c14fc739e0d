#pragma once

#include <string>

namespace limn::remote {

/// Whether all characters of a guest's name are visible: it is UTF-8 with single blanks between visible
/// characters, and nothing in it is invisible, reserved or turns the direction of text.
bool is_visible_name(const std::string& name);

/// Whether people may take one name for the other: they are equal after upper and lower case and characters
/// that look alike were unified (skeletons of Unicode Technical Standard 39).
bool look_alike(const std::string& a, const std::string& b);

}  // namespace limn::remote
