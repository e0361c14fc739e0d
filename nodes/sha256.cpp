#include "nodes/sha256.h"

#include <fmt/format.h>
#include <openssl/evp.h>
#include <openssl/rand.h>

#include <algorithm>
#include <array>
#include <vector>

#include "core/result.h"

namespace limn::nodes {
namespace {

constexpr std::size_t k_digits = 64;

template <class Bytes>
std::string hexadecimal(const Bytes& bytes, std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += fmt::format("{:02x}", bytes[i]);
  return text;
}

}  // namespace

void Sha256::Free::operator()(evp_md_ctx_st* context) const { EVP_MD_CTX_free(context); }

Sha256::Sha256() : context_(EVP_MD_CTX_new()) {
  LIMN_CHECK(context_ && EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) == 1);
}

void Sha256::add(std::string_view bytes) {
  LIMN_CHECK(EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()) == 1);
}

std::string Sha256::digest() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> bytes{};
  unsigned count = 0;
  LIMN_CHECK(EVP_DigestFinal_ex(context_.get(), bytes.data(), &count) == 1);
  return hexadecimal(bytes, count);
}

std::string sha256_of(std::string_view bytes) {
  Sha256 hash;
  hash.add(bytes);
  return hash.digest();
}

bool is_sha256(std::string_view text) {
  return text.size() == k_digits && std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

std::string random_secret(int bits) {
  std::vector<unsigned char> bytes(static_cast<std::size_t>(bits / 8));
  LIMN_CHECK(RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) == 1);
  return hexadecimal(bytes, bytes.size());
}

}  // namespace limn::nodes
