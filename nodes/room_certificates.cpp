#include "nodes/room_certificates.h"

#include <openssl/err.h>
#include <openssl/pkcs7.h>
#include <openssl/x509v3.h>

#include <array>
#include <memory>
#include <utility>

#include "nodes/room_documents.h"
#include "remote/http/x509.h"

namespace limn::nodes {
namespace {

constexpr std::time_t k_day = 24 * 60 * 60;
constexpr std::time_t k_lifetime = k_room_years * 365 * k_day;

using remote::Bio, remote::KeyPair, remote::X509Certificate;
using RoomStore = std::unique_ptr<X509_STORE, remote::FreeOpenSsl<X509_STORE_free>>;
using SignedDocument = std::unique_ptr<PKCS7, remote::FreeOpenSsl<PKCS7_free>>;

// Its subject is "CN=ROLE,O=ROOM".
KeyPair unsigned_room_pair(const std::string& room, const char* role, std::time_t now) {
  const std::array<std::pair<const char*, std::string>, 2> subject{{{"O", room}, {"CN", role}}};
  return remote::unsigned_pair(subject, now - k_day, now + k_lifetime);
}

// It also signs documents, so its certificate allows digital signatures.
KeyPair room_authority(const std::string& room, std::time_t now) {
  KeyPair out = unsigned_room_pair(room, "authority", now);
  X509* certificate = out.certificate.get();
  remote::add_extension(certificate, certificate, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  remote::add_extension(certificate, certificate, NID_key_usage, "critical,keyCertSign,digitalSignature");
  remote::add_extension(certificate, certificate, NID_subject_key_identifier, "hash");
  remote::sign(out, certificate);
  return out;
}

KeyPair room_identity(const KeyPair& authority, const std::string& room, const char* role, std::time_t now) {
  KeyPair out = unsigned_room_pair(room, role, now);
  X509 *certificate = out.certificate.get(), *issuer = authority.certificate.get();
  remote::add_extension(certificate, issuer, NID_basic_constraints, "critical,CA:FALSE");
  remote::add_extension(certificate, issuer, NID_key_usage, "critical,digitalSignature,keyAgreement");
  remote::add_extension(certificate, issuer, NID_authority_key_identifier, "keyid:always");
  remote::sign(authority, certificate);
  return out;
}

std::string subject_of(X509* certificate) {
  const Bio memory = remote::writable();
  LIMN_CHECK(X509_NAME_print_ex(memory.get(), X509_get_subject_name(certificate), 0, XN_FLAG_RFC2253) >= 0);
  return remote::content_of(memory.get());
}

// As `openssl smime -sign -text` does it.
std::string signed_document(const KeyPair& authority, const std::string& text) {
  constexpr int k_flags = PKCS7_TEXT | PKCS7_DETACHED | PKCS7_STREAM;
  const Bio in = remote::readable(text), out = remote::writable();
  const SignedDocument document(
      PKCS7_sign(authority.certificate.get(), authority.key.get(), nullptr, in.get(), k_flags));
  LIMN_CHECK(document && SMIME_write_PKCS7(out.get(), document.get(), in.get(), k_flags) == 1);
  return remote::content_of(out.get());
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
  out.authority = remote::pem_of(authority.certificate.get());
  out.host = remote::pem_of(host);
  out.node = remote::pem_of(node);
  out.governance = signed_document(authority, governance_document());
  out.permissions = signed_document(authority, permissions_document(subjects, now - k_day, now + k_lifetime));
  return out;
}

Result<RoomIdentity> read_identity(const std::string& pem,
                                   const std::string& authority,
                                   const std::string& where,
                                   std::time_t now) {
  const KeyPair pair{remote::key_in(pem), remote::certificate_in(pem)};
  const X509Certificate signer = remote::certificate_in(authority);
  if (!pair.key || !pair.certificate || X509_check_private_key(pair.certificate.get(), pair.key.get()) != 1)
    return damaged(where, "a private key and its certificate");
  if (!signer || X509_verify(pair.certificate.get(), X509_get0_pubkey(signer.get())) != 1)
    return damaged(where, "a certificate that the room's authority.pem has signed");
  LIMN_TRY_STATUS(check_validity(pair.certificate.get(), where, now));
  return RoomIdentity{room_name_of(pair.certificate.get()), remote::pem_of(pair.certificate.get()),
                      remote::pem_of(pair.key.get())};
}

Status check_document(const std::string& document, const std::string& authority, const std::string& where) {
  const X509Certificate signer = remote::certificate_in(authority);
  BIO* text = nullptr;
  const SignedDocument found(SMIME_read_PKCS7(remote::readable(document).get(), &text));
  const Bio content(text), out = remote::writable();
  const RoomStore store(X509_STORE_new());
  LIMN_CHECK(store);
  const bool is_signed =
      signer && found && X509_STORE_add_cert(store.get(), signer.get()) == 1 &&
      PKCS7_verify(found.get(), nullptr, store.get(), content.get(), out.get(), PKCS7_TEXT) == 1;
  if (!is_signed) return damaged(where, "a document that the room's authority.pem has signed");
  return {};
}

}  // namespace limn::nodes
