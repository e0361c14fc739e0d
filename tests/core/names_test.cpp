#include "core/names.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace limn {
namespace {

struct Thing {
  std::string name;
  int value = 0;
};

TEST(Names, AreJoinedForASentence) {
  EXPECT_EQ(joined_names(std::vector<std::string>{"left", "right"}), "left, right");
  EXPECT_EQ(joined_names(std::set<std::string>{"one"}), "one");
  EXPECT_EQ(joined_names(std::vector<Thing>{{"a"}, {"b"}, {"c"}}), "a, b, c");
}

TEST(Names, AnEmptyListSaysSo) {
  EXPECT_EQ(joined_names(std::vector<Thing>{}), "none");
  EXPECT_EQ(joined_names(std::vector<Thing>{}, ""), "");
}

TEST(Names, FindTheFirstThingOfAName) {
  std::vector<Thing> things = {{"a", 1}, {"b", 2}, {"b", 3}};
  ASSERT_NE(find_named(things, "b"), nullptr);
  EXPECT_EQ(find_named(things, "b")->value, 2);
  find_named(things, "a")->value = 7;
  EXPECT_EQ(things[0].value, 7);
  const std::vector<Thing>& fixed = things;
  EXPECT_EQ(find_named(fixed, "c"), nullptr);
}

}  // namespace
}  // namespace limn
