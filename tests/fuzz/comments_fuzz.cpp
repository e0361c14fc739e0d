// Comments of a project.
#include "scene/comments.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "comments.json");
  const auto comments = scene::load_comments(file);
  test::check_read(comments, file);
  if (!comments) return 0;
  for (const scene::Comment& comment : *comments)
    LIMN_CHECK(!comment.text.empty() && comment.text.size() <= scene::k_longest_comment);
  return 0;
}
