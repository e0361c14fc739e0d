#include "nodes/room_certificates.h"

#include <openssl/bio.h>
#include <openssl/bn.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/rand.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <array>
#include <memory>

#include "nodes/room_documents.h"

namespace limn::nodes {
namespace {

constexpr std::time_t k_day = 24 * 60 * 60;
constexpr std::time_t k_lifetime = k_room_years * 365 * k_day;

template <auto free>
struct FreeRoomObject {
  template <class T>
  void operator()(T* object) const {
    free(object);
  }
};
using RoomKey = std::unique_ptr<EVP_PKEY, FreeRoomObject<EVP_PKEY_free>>;
using RoomCertificate = std::unique_ptr<X509, FreeRoomObject<X509_free>>;
using RoomBio = std::unique_ptr<BIO, FreeRoomObject<BIO_free>>;
using RoomStore = std::unique_ptr<X509_STORE, FreeRoomObject<X509_STORE_free>>;
using SignedDocument = std::unique_ptr<PKCS7, FreeRoomObject<PKCS7_free>>;

struct KeyPair {
  RoomKey key;
  RoomCertificate certificate;
};

RoomBio opened(const std::string& text) {
  return RoomBio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

std::string content_of(BIO* memory) {
  char* text = nullptr;
  const long length = BIO_get_mem_data(memory, &text);
  return {text, static_cast<std::size_t>(length)};
}

void set_random_serial(X509* certificate) {
  std::array<unsigned char, 16> serial{};
  LIMN_CHECK(RAND_bytes(serial.data(), static_cast<int>(serial.size())) == 1);
  serial[0] &= 0x7f;
  const std::unique_ptr<BIGNUM, FreeRoomObject<BN_free>> number(
      BN_bin2bn(serial.data(), static_cast<int>(serial.size()), nullptr));
  LIMN_CHECK(number && BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate)));
}

void add_name(X509_NAME* to, const char* entry, const std::string& text) {
  LIMN_CHECK(X509_NAME_add_entry_by_txt(to, entry, MBSTRING_UTF8,
                                        reinterpret_cast<const unsigned char*>(text.c_str()), -1, -1,
                                        0) == 1);
}

void add_room_extension(X509* certificate, X509* issuer, int kind, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const std::unique_ptr<X509_EXTENSION, FreeRoomObject<X509_EXTENSION_free>> extension(
      X509V3_EXT_conf_nid(nullptr, &context, kind, value));
  LIMN_CHECK(extension && X509_add_ext(certificate, extension.get(), -1) == 1);
}

// A key and its certificate, without extensions, not yet signed. Its subject is "CN=ROLE,O=ROOM".
KeyPair unsigned_room_pair(const std::string& room, const char* role, std::time_t now) {
  KeyPair out{RoomKey(EVP_EC_gen("P-256")), RoomCertificate(X509_new())};
  X509* certificate = out.certificate.get();
  LIMN_CHECK(out.key && certificate);
  set_random_serial(certificate);
  X509_set_version(certificate, X509_VERSION_3);
  ASN1_TIME_set(X509_getm_notBefore(certificate), now - k_day);
  ASN1_TIME_set(X509_getm_notAfter(certificate), now + k_lifetime);
  add_name(X509_get_subject_name(certificate), "O", room);
  add_name(X509_get_subject_name(certificate), "CN", role);
  X509_set_pubkey(certificate, out.key.get());
  return out;
}

void sign_certificate(const KeyPair& authority, X509* certificate) {
  X509_set_issuer_name(certificate, X509_get_subject_name(authority.certificate.get()));
  LIMN_CHECK(X509_sign(certificate, authority.key.get(), EVP_sha256()) > 0);
}

// It also signs documents, so its certificate allows digital signatures.
KeyPair room_authority(const std::string& room, std::time_t now) {
  KeyPair out = unsigned_room_pair(room, "authority", now);
  X509* certificate = out.certificate.get();
  add_room_extension(certificate, certificate, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  add_room_extension(certificate, certificate, NID_key_usage, "critical,keyCertSign,digitalSignature");
  add_room_extension(certificate, certificate, NID_subject_key_identifier, "hash");
  sign_certificate(out, certificate);
  return out;
}

KeyPair room_identity(const KeyPair& authority, const std::string& room, const char* role, std::time_t now) {
  KeyPair out = unsigned_room_pair(room, role, now);
  X509 *certificate = out.certificate.get(), *issuer = authority.certificate.get();
  add_room_extension(certificate, issuer, NID_basic_constraints, "critical,CA:FALSE");
  add_room_extension(certificate, issuer, NID_key_usage, "critical,digitalSignature,keyAgreement");
  add_room_extension(certificate, issuer, NID_authority_key_identifier, "keyid:always");
  sign_certificate(authority, certificate);
  return out;
}

std::string room_pem(const KeyPair& pair, bool with_key) {
  const RoomBio memory(BIO_new(BIO_s_mem()));
  LIMN_CHECK(memory);
  if (with_key)
    LIMN_CHECK(
        PEM_write_bio_PrivateKey(memory.get(), pair.key.get(), nullptr, nullptr, 0, nullptr, nullptr) == 1);
  LIMN_CHECK(PEM_write_bio_X509(memory.get(), pair.certificate.get()) == 1);
  return content_of(memory.get());
}

std::string subject_of(X509* certificate) {
  const RoomBio memory(BIO_new(BIO_s_mem()));
  LIMN_CHECK(memory &&
             X509_NAME_print_ex(memory.get(), X509_get_subject_name(certificate), 0, XN_FLAG_RFC2253) >= 0);
  return content_of(memory.get());
}

// As `openssl smime -sign -text` does it.
std::string signed_document(const KeyPair& authority, const std::string& text) {
  constexpr int k_flags = PKCS7_TEXT | PKCS7_DETACHED | PKCS7_STREAM;
  const RoomBio in = opened(text), out(BIO_new(BIO_s_mem()));
  const SignedDocument document(
      PKCS7_sign(authority.certificate.get(), authority.key.get(), nullptr, in.get(), k_flags));
  LIMN_CHECK(document && out && SMIME_write_PKCS7(out.get(), document.get(), in.get(), k_flags) == 1);
  return content_of(out.get());
}

RoomCertificate read_certificate(const std::string& pem) {
  RoomCertificate found(PEM_read_bio_X509(opened(pem).get(), nullptr, nullptr, nullptr));
  ERR_clear_error();
  return found;
}

Error damaged(const std::string& where, const char* expected) {
  ERR_clear_error();
  return error(
      "{}: expected {}, found something else. Copy the room's folder from a machine on which it works.",
      where, expected);
}

Status check_validity(X509* certificate, const std::string& where, std::time_t now) {
  if (X509_cmp_time(X509_get0_notBefore(certificate), &now) >= 0)
    return error(
        "{}: expected keys that are valid now, found keys that are valid later: this machine's clock is "
        "wrong. Set "
        "it.",
        where);
  if (X509_cmp_time(X509_get0_notAfter(certificate), &now) <= 0)
    return error(
        "{}: expected keys that are valid now, found keys that have expired. Check this machine's clock, "
        "else make a "
        "new room with limn room create.",
        where);
  return {};
}

std::string room_name_of(X509* certificate) {
  std::array<char, 128> text{};
  X509_NAME_get_text_by_NID(X509_get_subject_name(certificate), NID_organizationName, text.data(),
                            static_cast<int>(text.size()));
  return text.data();
}

}  // namespace

RoomFiles make_room_files(const std::string& name, std::time_t now) {
  const KeyPair authority = room_authority(name, now);
  const KeyPair host = room_identity(authority, name, "host", now);
  const KeyPair node = room_identity(authority, name, "node", now);
  const RoomSubjects subjects{subject_of(host.certificate.get()), subject_of(node.certificate.get())};
  RoomFiles out;
  out.authority = room_pem(authority, false);
  out.host = room_pem(host, true);
  out.node = room_pem(node, true);
  out.governance = signed_document(authority, governance_document());
  out.permissions = signed_document(authority, permissions_document(subjects, now - k_day, now + k_lifetime));
  return out;
}

Result<RoomIdentity> read_identity(const std::string& pem,
                                   const std::string& authority,
                                   const std::string& where,
                                   std::time_t now) {
  KeyPair pair{RoomKey(PEM_read_bio_PrivateKey(opened(pem).get(), nullptr, nullptr, nullptr)),
               read_certificate(pem)};
  const RoomCertificate signer = read_certificate(authority);
  ERR_clear_error();
  if (!pair.key || !pair.certificate || X509_check_private_key(pair.certificate.get(), pair.key.get()) != 1)
    return damaged(where, "a private key and its certificate");
  if (!signer || X509_verify(pair.certificate.get(), X509_get0_pubkey(signer.get())) != 1)
    return damaged(where, "a certificate that the room's authority.pem has signed");
  LIMN_TRY_STATUS(check_validity(pair.certificate.get(), where, now));
  const std::string both = room_pem(pair, true), certificate = room_pem(pair, false);
  return RoomIdentity{room_name_of(pair.certificate.get()), certificate,
                      both.substr(0, both.size() - certificate.size())};
}

Status check_document(const std::string& document, const std::string& authority, const std::string& where) {
  const RoomCertificate signer = read_certificate(authority);
  BIO* text = nullptr;
  const SignedDocument found(SMIME_read_PKCS7(opened(document).get(), &text));
  const RoomBio content(text), out(BIO_new(BIO_s_mem()));
  const RoomStore store(X509_STORE_new());
  LIMN_CHECK(store && out);
  const bool is_signed =
      signer && found && X509_STORE_add_cert(store.get(), signer.get()) == 1 &&
      PKCS7_verify(found.get(), nullptr, store.get(), content.get(), out.get(), PKCS7_TEXT) == 1;
  if (!is_signed) return damaged(where, "a document that the room's authority.pem has signed");
  return {};
}

}  // namespace limn::nodes
