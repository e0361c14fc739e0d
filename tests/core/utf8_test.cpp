#include "core/utf8.h"

#include <gtest/gtest.h>

#include "core/html.h"
#include "core/json_text.h"

namespace limn {
namespace {

TEST(Utf8, IsToldFromOtherBytes) {
  for (const char* text : {"", "mirror", "gr\xc3\xbcn", "\xe2\x82\xac", "\xf0\x9f\x9a\x97"})
    EXPECT_TRUE(is_utf8(text)) << text;
  for (const char* bytes : {"gr\xfcn", "\xc3", "\xe2\x82", "\xc0\xaf", "\xed\xa0\x80", "\xf5\x80\x80\x80"})
    EXPECT_FALSE(is_utf8(bytes)) << as_utf8(bytes);
}

TEST(Utf8, OtherBytesAreReplacedAndTheRestStays) {
  EXPECT_EQ(as_utf8("gr\xc3\xbcn"), "gr\xc3\xbcn");
  EXPECT_EQ(as_utf8("gr\xfcn"), "gr\xef\xbf\xbdn");
  EXPECT_EQ(as_utf8("cut \xe2\x82"), "cut \xef\xbf\xbd");
}

TEST(Utf8, JsonAndPagesAreWrittenWithAnyBytes) {
  const std::string name = "gr\xfcn";
  EXPECT_EQ(json_text(nlohmann::json{{"name", name}}), "{\"name\":\"gr\xef\xbf\xbdn\"}");
  EXPECT_EQ(escaped(name), "gr\xef\xbf\xbdn");
}

}  // namespace
}  // namespace limn
