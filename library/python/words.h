#pragma once

#include <pybind11/pybind11.h>

#include <array>
#include <string>
#include <type_traits>

#include "limn/limn.h"

/// Python writes the values of the library's enums as words: "bgr", "lost".
namespace limn::python {

template <class E>
struct Word {
  const char* word;
  E value;
};
template <class E>
Word(const char*, E) -> Word<E>;

template <class E>
inline constexpr std::array<Word<E>, 0> k_words = {};

template <>
inline constexpr std::array k_words<PixelFormat> = {
    Word{"grey", PixelFormat::grey}, Word{"rgb", PixelFormat::rgb}, Word{"bgr", PixelFormat::bgr}};
template <>
inline constexpr std::array k_words<Encoding> = {Word{"linear", Encoding::linear},
                                                 Word{"srgb", Encoding::srgb}};
template <>
inline constexpr std::array k_words<Tracking> = {Word{"measured", Tracking::measured},
                                                 Word{"extrapolated", Tracking::extrapolated},
                                                 Word{"lost", Tracking::lost}};
template <>
inline constexpr std::array k_words<CameraFile> = {
    Word{"mrcal", CameraFile::mrcal}, Word{"opencv", CameraFile::opencv}, Word{"ros", CameraFile::ros}};
template <>
inline constexpr std::array k_words<Verdict> = {Word{"good", Verdict::good}, Word{"usable", Verdict::usable},
                                                Word{"reject", Verdict::reject}};
template <>
inline constexpr std::array k_words<Unit> = {Word{"metre", Unit::metre}, Word{"centimetre", Unit::centimetre},
                                             Word{"millimetre", Unit::millimetre}, Word{"inch", Unit::inch},
                                             Word{"foot", Unit::foot}};
template <>
inline constexpr std::array k_words<GlContext> = {Word{"headless", GlContext::headless},
                                                  Word{"current", GlContext::current}};
template <>
inline constexpr std::array k_words<MarkerLight> = {Word{"as_is", MarkerLight::as_is},
                                                    Word{"keep_out", MarkerLight::keep_out},
                                                    Word{"spotlight", MarkerLight::spotlight}};
template <>
inline constexpr std::array k_words<Composite> = {Word{"rest", Composite::rest},
                                                  Word{"full", Composite::full}};

}  // namespace limn::python

namespace pybind11::detail {

template <class E>
class type_caster<E, std::enable_if_t<std::is_enum_v<E> && !limn::python::k_words<E>.empty()>> {
 public:
  PYBIND11_TYPE_CASTER(E, const_name("str"));

  /// ValueError: another word.
  bool load(handle source, bool) {
    if (!isinstance<str>(source)) return false;
    const std::string found = reinterpret_borrow<str>(source);
    std::string all;
    for (const auto& [word, meaning] : limn::python::k_words<E>) {
      if (found == word) {
        value = meaning;
        return true;
      }
      all += (all.empty() ? "'" : ", '") + std::string(word) + "'";
    }
    throw value_error("expected one of " + all + ", found '" + found + "'.");
  }

  static handle cast(E meaning, return_value_policy, handle) {
    for (const auto& [word, value] : limn::python::k_words<E>)
      if (value == meaning) return str(word).release();
    return none().release();
  }
};

}  // namespace pybind11::detail
