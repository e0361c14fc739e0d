#include "scene/comments.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/time_now.h"
#include "core/utf8.h"

namespace limn::scene {
namespace {

// Whether the text is UTF-8 without control characters other than line feeds.
bool is_text(const std::string& text) {
  const auto is_control = [](unsigned char c) { return (c < 0x20 && c != '\n') || c == 0x7f; };
  if (std::any_of(text.begin(), text.end(), is_control)) return false;
  return is_utf8(text);
}

Status check(const Comment& comment) {
  for (const std::string* name : {&comment.who, &comment.look, &comment.slot})
    if (name->size() > k_longest_name || !is_text(*name))
      return error("comment: expected names of at most {} bytes of text, found '{}'.", k_longest_name,
                   is_text(*name) ? *name : "?");
  if (comment.text.empty() || comment.text.size() > k_longest_comment || !is_text(comment.text))
    return error("comment: expected text of 1 to {} bytes without control characters, found {} bytes.",
                 k_longest_comment, comment.text.size());
  return {};
}

}  // namespace

Result<Comment> make_comment(const std::string& who,
                             const std::string& look,
                             const std::string& slot,
                             const std::string& text) {
  Comment comment{time_now(), who, look, slot, text};
  LIMN_TRY_STATUS(check(comment));
  return comment;
}

Result<std::vector<Comment>> load_comments(const std::filesystem::path& path) {
  std::error_code none;
  if (!std::filesystem::exists(path, none)) return std::vector<Comment>();
  LIMN_TRY(const Config config, Config::load(path, "limn.comments/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "comments"});
  std::vector<Comment> comments;
  for (const ConfigNode& node : root.at("comments").items()) {
    node.only({"at", "who", "look", "slot", "text"});
    comments.push_back({node.at("at").text(), node.at("who").text(), node.at("look").text(),
                        node.at("slot").text(), node.at("text").text()});
    if (const Status is = check(comments.back()); !is) node.problem(is.message());
  }
  LIMN_TRY_STATUS(config.status());
  return comments;
}

Status save_comments(const std::filesystem::path& path, const std::vector<Comment>& comments) {
  if (comments.size() > k_most_comments)
    return error("{}: expected at most {} comments, found {}. Move the file elsewhere to start a new one.",
                 path.string(), k_most_comments, comments.size());
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const Comment& comment : comments)
    all.push_back({{"at", comment.at},
                   {"who", comment.who},
                   {"look", comment.look},
                   {"slot", comment.slot},
                   {"text", comment.text}});
  return write_file(
      path, json_text(nlohmann::ordered_json({{"schema", "limn.comments/1"}, {"comments", all}}), 2) + "\n");
}

}  // namespace limn::scene
