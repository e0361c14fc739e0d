#include "scene/comments.h"

#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

TEST(Comments, AreKeptWithTheProject) {
  const std::filesystem::path file = test::test_folder() / "comments.json";
  EXPECT_TRUE(load_comments(file).value().empty());
  const auto first = make_comment("Ann", "evening", "mirror", "\u00fcber <b>\"all\"</b>\nhigher"),
             second = make_comment("", "", "", "!");
  ASSERT_TRUE(first && second) << first.message() << second.message();
  EXPECT_EQ(first->at.size(), std::string("2026-01-31T12:00:00Z").size());
  ASSERT_TRUE(save_comments(file, {*first, *second}));
  const auto loaded = load_comments(file);
  ASSERT_TRUE(loaded) << loaded.message();
  ASSERT_EQ(loaded->size(), 2U);
  EXPECT_EQ(loaded->front().text, first->text);
  EXPECT_EQ(loaded->front().slot, "mirror");
  EXPECT_EQ(loaded->front().look, "evening");
  EXPECT_EQ(loaded->front().who, "Ann");
  EXPECT_EQ(loaded->front().at, first->at);
  EXPECT_EQ(loaded->back().text, "!");
}

TEST(Comments, AreBoundedText) {
  const std::string longest(k_longest_comment, 'x');
  EXPECT_TRUE(make_comment("Ann", "", "", longest));
  for (const std::string& bad :
       {std::string(), longest + "x", std::string("\x07"), std::string("\xff\xfe"), std::string(1, '\0')})
    EXPECT_FALSE(make_comment("Ann", "", "", bad)) << bad.size();
  EXPECT_FALSE(make_comment(std::string(k_longest_name + 1, 'x'), "", "", "text"));
  EXPECT_FALSE(make_comment("Ann", "\xff", "", "text"));
  EXPECT_FALSE(save_comments(test::test_folder() / "many.json",
                             std::vector<Comment>(k_most_comments + 1, Comment{"", "", "", "", "x"})));
}

TEST(Comments, SaysWhereAFileIsDamaged) {
  const std::filesystem::path file = test::test_folder() / "comments.json";
  ASSERT_TRUE(write_file(
      file,
      R"({"schema": "limn.comments/1", "comments": [{"at": "x", "who": "", "look": "", "slot": "", "text": ""}]})"));
  const auto loaded = load_comments(file);
  ASSERT_FALSE(loaded);
  EXPECT_NE(loaded.message().find("comments[0]"), std::string::npos) << loaded.message();
  ASSERT_TRUE(write_file(file, "{"));
  EXPECT_FALSE(load_comments(file));
}

}  // namespace
}  // namespace limn::scene
