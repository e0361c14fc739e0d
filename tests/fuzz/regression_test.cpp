// Runs a fuzz target on its seeds and on some thousand mutations of them, the same ones every time.
#include "tests/fuzz/regression.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "core/file.h"
#include "tests/fuzz/fuzz_file.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> seeds() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(test::k_fuzz_corpus)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<std::string> contents;
  for (const fs::path& file : files) contents.push_back(read_file(file).value());
  return contents;
}

// Draws random positions and pieces of text.
class Mutator {
 public:
  explicit Mutator(const std::vector<std::string>& seeds) : seeds_(seeds) {}

  std::string mutated() {
    std::string text = any_seed();
    for (int changes = below(4); changes >= 0; --changes) change(&text);
    return text;
  }

 private:
  std::mt19937_64 rng_ = test::test_rng();
  const std::vector<std::string>& seeds_;

  int below(std::size_t count) {
    return std::uniform_int_distribution<int>(0, static_cast<int>(count) - 1)(rng_);
  }
  std::size_t place(const std::string& text) { return static_cast<std::size_t>(below(text.size() + 1)); }
  const std::string& any_seed() { return seeds_[static_cast<std::size_t>(below(seeds_.size()))]; }
  std::string piece(const std::string& text) {
    return text.substr(place(text), static_cast<std::size_t>(below(64)));
  }

  void change(std::string* text) {
    static const std::vector<std::string> words = {
        "nan", "inf", "-1", "1e999", "99999999999",      "0", "[", "{", "\"", "\n", ": ", "\xff\xff",
        "&a ", "*a",  "!!", "- ",    "rows: 1000000000", "%"};
    const std::size_t at = place(*text);
    switch (below(6)) {
      case 0:
        if (at < text->size()) (*text)[at] = static_cast<char>(rng_());
        break;
      case 1:
        if (at < text->size()) (*text)[at] ^= static_cast<char>(1 << below(8));
        break;
      case 2:
        text->erase(at, static_cast<std::size_t>(below(64)));
        break;
      case 3:
        text->insert(at, words[static_cast<std::size_t>(below(words.size()))]);
        break;
      case 4:
        text->insert(at, piece(any_seed()));
        break;
      default:
        text->resize(at);
    }
  }
};

// After a crash the input remains where fuzzed_file put it.
void feed(const std::string& input) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(input.data());
  test::fuzzed_file(bytes, input.size(), "input");
  EXPECT_NO_THROW(LLVMFuzzerTestOneInput(bytes, input.size()));
  if (!testing::Test::HasFailure()) return;
  const auto kept = test::test_folder() / "input";
  ASSERT_TRUE(write_file(kept, input));
  FAIL() << "the input is kept in " << kept;
}

TEST(Fuzz, SeedsAndMutationsOfThemAreReadOrRefused) {
  const std::vector<std::string> all = seeds();
  ASSERT_FALSE(all.empty());
  for (const std::string& seed : all) feed(seed);
  Mutator mutator(all);
  for (int i = 0; i < test::k_fuzz_runs && !HasFailure(); ++i) feed(mutator.mutated());
}

}  // namespace
}  // namespace limn
