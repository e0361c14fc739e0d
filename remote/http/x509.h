#pragma once

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/x509.h>

#include <ctime>
#include <memory>
#include <span>
#include <string>
#include <utility>

namespace limn::remote {

/// Deletes an object of OpenSSL by its own function.
template <auto free>
struct FreeOpenSsl {
  template <class T>
  void operator()(T* object) const {
    free(object);
  }
};
using Key = std::unique_ptr<EVP_PKEY, FreeOpenSsl<EVP_PKEY_free>>;
using X509Certificate = std::unique_ptr<X509, FreeOpenSsl<X509_free>>;
using Bio = std::unique_ptr<BIO, FreeOpenSsl<BIO_free>>;

struct KeyPair {
  Key key;
  X509Certificate certificate;
};

/// A new key (EC P-256) and its certificate with a random serial number, without extensions, not yet signed.
/// `subject`: its entries, such as {"CN", "Limn"}.
KeyPair unsigned_pair(std::span<const std::pair<const char*, std::string>> subject,
                      std::time_t from,
                      std::time_t until);
/// Adds an extension (an NID and OpenSSL's text for its value). `issuer` may be the certificate itself.
void add_extension(X509* certificate, X509* issuer, int kind, const std::string& value);
/// Signs a certificate and names its issuer.
void sign(const KeyPair& authority, X509* certificate);

/// The texts as PEM; of a pair the key comes first.
std::string pem_of(X509* certificate);
std::string pem_of(EVP_PKEY* key);
std::string pem_of(const KeyPair& pair);
/// The key, or the certificate, in a PEM text; null: there is none.
Key key_in(const std::string& pem);
X509Certificate certificate_in(const std::string& pem);

/// The SHA-256 of a certificate, "AB:CD:…".
std::string fingerprint_of(X509* certificate);

/// Memory that OpenSSL reads, which must outlive the result; memory that it writes; what it has written.
Bio readable(const std::string& text);
Bio writable();
std::string content_of(BIO* memory);

}  // namespace limn::remote
