#include "core/csv.h"

#include <gtest/gtest.h>

namespace limn {
namespace {

TEST(Csv, QuotesWhatWouldBeAnotherField) {
  EXPECT_EQ(csv_field("plain name.png"), "plain name.png");
  EXPECT_EQ(csv_field("a,b.png"), "\"a,b.png\"");
  EXPECT_EQ(csv_field("6\" tile.png"), "\"6\"\" tile.png\"");
  EXPECT_EQ(csv_field("two\nlines"), "\"two\nlines\"");
  EXPECT_EQ(csv_field(" led by a blank"), "\" led by a blank\"");
  EXPECT_EQ(csv_field(""), "");
}

TEST(Csv, BytesThatAreNotUtf8AreReplaced) { EXPECT_EQ(csv_field("caf\xe9.png"), "caf\xef\xbf\xbd.png"); }

}  // namespace
}  // namespace limn
