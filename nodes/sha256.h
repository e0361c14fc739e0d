#pragma once

#include <memory>
#include <string>
#include <string_view>

struct evp_md_ctx_st;

namespace limn::nodes {

/// The SHA-256 of bytes that are added one after another.
class Sha256 {
 public:
  Sha256();
  void add(std::string_view bytes);
  /// 64 hexadecimal digits in lower case. Called once, after the last add().
  std::string digest();

 private:
  struct Free {
    void operator()(evp_md_ctx_st* context) const;
  };
  std::unique_ptr<evp_md_ctx_st, Free> context_;
};

/// The SHA-256 of all of `bytes`, as Sha256::digest().
std::string sha256_of(std::string_view bytes);

/// Whether it is written as Sha256::digest() writes it, and so is a safe name of a file.
bool is_sha256(std::string_view text);

/// Random bits for a secret, as hexadecimal digits in lower case.
std::string random_secret(int bits);

}  // namespace limn::nodes
