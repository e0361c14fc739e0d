#include "remote/http/x509.h"

#include <fmt/format.h>
#include <openssl/bn.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>

#include <array>

#include "core/result.h"

namespace limn::remote {
namespace {

void set_random_serial(X509* certificate) {
  std::array<unsigned char, 16> serial{};
  LIMN_CHECK(RAND_bytes(serial.data(), static_cast<int>(serial.size())) == 1);
  serial[0] &= 0x7f;
  const std::unique_ptr<BIGNUM, FreeOpenSsl<BN_free>> number(
      BN_bin2bn(serial.data(), static_cast<int>(serial.size()), nullptr));
  LIMN_CHECK(number && BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate)));
}

}  // namespace

KeyPair unsigned_pair(std::span<const std::pair<const char*, std::string>> subject,
                      std::time_t from,
                      std::time_t until) {
  KeyPair out{Key(EVP_EC_gen("P-256")), X509Certificate(X509_new())};
  X509* certificate = out.certificate.get();
  LIMN_CHECK(out.key && certificate);
  set_random_serial(certificate);
  X509_set_version(certificate, X509_VERSION_3);
  ASN1_TIME_set(X509_getm_notBefore(certificate), from);
  ASN1_TIME_set(X509_getm_notAfter(certificate), until);
  for (const auto& [entry, text] : subject)
    LIMN_CHECK(X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate), entry, MBSTRING_UTF8,
                                          reinterpret_cast<const unsigned char*>(text.c_str()), -1, -1,
                                          0) == 1);
  X509_set_pubkey(certificate, out.key.get());
  return out;
}

void add_extension(X509* certificate, X509* issuer, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const std::unique_ptr<X509_EXTENSION, FreeOpenSsl<X509_EXTENSION_free>> extension(
      X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  LIMN_CHECK(extension && X509_add_ext(certificate, extension.get(), -1) == 1);
}

void sign(const KeyPair& authority, X509* certificate) {
  X509_set_issuer_name(certificate, X509_get_subject_name(authority.certificate.get()));
  LIMN_CHECK(X509_sign(certificate, authority.key.get(), EVP_sha256()) > 0);
}

std::string pem_of(X509* certificate) {
  const Bio memory = writable();
  LIMN_CHECK(PEM_write_bio_X509(memory.get(), certificate) == 1);
  return content_of(memory.get());
}

std::string pem_of(EVP_PKEY* key) {
  const Bio memory = writable();
  LIMN_CHECK(PEM_write_bio_PrivateKey(memory.get(), key, nullptr, nullptr, 0, nullptr, nullptr) == 1);
  return content_of(memory.get());
}

std::string pem_of(const KeyPair& pair) { return pem_of(pair.key.get()) + pem_of(pair.certificate.get()); }

Key key_in(const std::string& pem) {
  Key found(PEM_read_bio_PrivateKey(readable(pem).get(), nullptr, nullptr, nullptr));
  ERR_clear_error();
  return found;
}

X509Certificate certificate_in(const std::string& pem) {
  X509Certificate found(PEM_read_bio_X509(readable(pem).get(), nullptr, nullptr, nullptr));
  ERR_clear_error();
  return found;
}

std::string fingerprint_of(X509* certificate) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  LIMN_CHECK(X509_digest(certificate, EVP_sha256(), digest.data(), &length) == 1);
  std::string text;
  for (std::size_t i = 0; i < length; ++i) text += fmt::format("{}{:02X}", i > 0 ? ":" : "", digest[i]);
  return text;
}

Bio readable(const std::string& text) {
  Bio out(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  LIMN_CHECK(out);
  return out;
}

Bio writable() {
  Bio out(BIO_new(BIO_s_mem()));
  LIMN_CHECK(out);
  return out;
}

std::string content_of(BIO* memory) {
  char* text = nullptr;
  const long length = BIO_get_mem_data(memory, &text);
  return {text, static_cast<std::size_t>(length)};
}

}  // namespace limn::remote
