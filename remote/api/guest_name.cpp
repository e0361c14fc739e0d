#include "remote/api/guest_name.h"

#include <unicode/uchar.h>
#include <unicode/unistr.h>
#include <unicode/uspoof.h>

#include <memory>

#include "core/result.h"
#include "core/utf8.h"

namespace limn::remote {
namespace {

bool is_visible(UChar32 c) {
  constexpr std::uint32_t k_other = U_GC_C_MASK;  // controls, format characters, unassigned, private use
  return (U_MASK(u_charType(c)) & k_other) == 0 && !u_isUWhiteSpace(c) &&
         !u_hasBinaryProperty(c, UCHAR_DEFAULT_IGNORABLE_CODE_POINT);
}

icu::UnicodeString skeleton(const std::string& name) {
  UErrorCode problem = U_ZERO_ERROR;
  static const std::unique_ptr<USpoofChecker, void (*)(USpoofChecker*)> checker(uspoof_open(&problem),
                                                                                uspoof_close);
  icu::UnicodeString out;
  uspoof_getSkeletonUnicodeString(checker.get(), 0, icu::UnicodeString::fromUTF8(name).foldCase(), out,
                                  &problem);
  LIMN_CHECK(U_SUCCESS(problem));
  return out.foldCase();
}

}  // namespace

bool is_visible_name(const std::string& name) {
  if (!is_utf8(name)) return false;
  const auto text = icu::UnicodeString::fromUTF8(name);
  bool was_blank = true;  // the name does not begin with a blank
  for (std::int32_t i = 0; i < text.length(); i = text.moveIndex32(i, 1)) {
    const UChar32 c = text.char32At(i);
    if (c == ' ' ? was_blank : !is_visible(c)) return false;
    was_blank = c == ' ';
  }
  return !was_blank;
}

bool look_alike(const std::string& a, const std::string& b) { return skeleton(a) == skeleton(b); }

}  // namespace limn::remote
