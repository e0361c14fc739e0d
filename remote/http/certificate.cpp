#include "remote/http/certificate.h"

#include <arpa/inet.h>
#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>

#include "core/file.h"
#include "device/udp_socket.h"
#include "remote/http/own_addresses.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;

constexpr const char *k_file = "remote.pem", *k_authority_file = "authority.pem";
constexpr long k_day_s = 24 * 60 * 60;
// What an authority may sign for besides its hosts: networks that cannot be reached from outside (RFC 1918,
// 3927, 4193, 4291), this machine, and names of mDNS.
constexpr const char* k_permitted =
    "critical,permitted;DNS:local,permitted;DNS:localhost,"
    "permitted;IP:127.0.0.0/255.0.0.0,permitted;IP:10.0.0.0/255.0.0.0,permitted;IP:172.16.0.0/255.240.0.0,"
    "permitted;IP:192.168.0.0/255.255.0.0,permitted;IP:169.254.0.0/255.255.0.0,"
    "permitted;IP:fc00::/fe00::,permitted;IP:fe80::/ffc0::,"
    "permitted;IP:::1/ffff:ffff:ffff:ffff:ffff:ffff:ffff:ffff";

template <auto free>
struct Free {
  template <class T>
  void operator()(T* object) const {
    free(object);
  }
};
using Key = std::unique_ptr<EVP_PKEY, Free<EVP_PKEY_free>>;
using X509Certificate = std::unique_ptr<X509, Free<X509_free>>;
using Bio = std::unique_ptr<BIO, Free<BIO_free>>;
using Extension = std::unique_ptr<X509_EXTENSION, Free<X509_EXTENSION_free>>;
using NameConstraints = std::unique_ptr<NAME_CONSTRAINTS, Free<NAME_CONSTRAINTS_free>>;

struct Pair {
  Key key;
  X509Certificate certificate;
};

bool is_for(X509* certificate, const std::string& host) {
  return device::numeric_address(host)
             ? X509_check_ip_asc(certificate, host.c_str(), 0) == 1
             : X509_check_host(certificate, host.data(), host.size(), 0, nullptr) == 1;
}

bool is_for_all(X509* certificate, const std::vector<std::string>& hosts) {
  for (const std::string& host : hosts)
    if (!is_for(certificate, host)) return false;
  return true;
}

bool ends_within(long days, X509* certificate) {
  std::time_t then = std::time(nullptr) + days * k_day_s;
  return X509_cmp_time(X509_get0_notAfter(certificate), &then) <= 0;
}

std::string fingerprint_of(X509* certificate) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  LIMN_CHECK(X509_digest(certificate, EVP_sha256(), digest.data(), &length) == 1);
  std::string text;
  for (std::size_t i = 0; i < length; ++i) text += fmt::format("{}{:02X}", i > 0 ? ":" : "", digest[i]);
  return text;
}

void add_extension(X509* certificate, X509* issuer, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  LIMN_CHECK(extension && X509_add_ext(certificate, extension.get(), -1) == 1);
}

std::string alternative_names(const std::vector<std::string>& hosts) {
  std::string names;
  for (const std::string& host : hosts)
    names +=
        fmt::format("{}{}:{}", names.empty() ? "" : ",", device::numeric_address(host) ? "IP" : "DNS", host);
  return names;
}

std::string permitted_names(const std::vector<std::string>& hosts) {
  std::string names = k_permitted;
  for (const std::string& host : hosts) {
    const bool is_v6 = host.find(':') != std::string::npos;
    names += device::numeric_address(host)
                 ? fmt::format(",permitted;IP:{}/{}", host,
                               is_v6 ? "ffff:ffff:ffff:ffff:ffff:ffff:ffff:ffff" : "255.255.255.255")
                 : fmt::format(",permitted;DNS:{}", host);
  }
  return names;
}

// A key and its certificate, without extensions, not yet signed.
Pair unsigned_pair(const std::string& name, int days) {
  Pair out{Key(EVP_EC_gen("P-256")), X509Certificate(X509_new())};
  X509* certificate = out.certificate.get();
  std::array<unsigned char, 16> serial{};
  LIMN_CHECK(out.key && certificate && RAND_bytes(serial.data(), static_cast<int>(serial.size())) == 1);
  serial[0] &= 0x7f;
  const std::unique_ptr<BIGNUM, Free<BN_free>> number(
      BN_bin2bn(serial.data(), static_cast<int>(serial.size()), nullptr));
  LIMN_CHECK(number && BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate)));
  X509_set_version(certificate, X509_VERSION_3);
  X509_gmtime_adj(X509_getm_notBefore(certificate), -k_day_s);  // for phones whose clocks are slow
  X509_gmtime_adj(X509_getm_notAfter(certificate), days * k_day_s);
  X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate), "CN", MBSTRING_UTF8,
                             reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
  X509_set_pubkey(certificate, out.key.get());
  return out;
}

void sign(const Pair& authority, X509* certificate) {
  X509_set_issuer_name(certificate, X509_get_subject_name(authority.certificate.get()));
  LIMN_CHECK(X509_sign(certificate, authority.key.get(), EVP_sha256()) > 0);
}

Pair make_authority(const std::vector<std::string>& hosts) {
  constexpr std::size_t k_most = 40;  // letters of the machine's name; a certificate's name has 64 at most
  const std::string machine = own_host_name().substr(0, k_most);
  Pair out = unsigned_pair(machine.empty() ? "Limn" : "Limn on " + machine, k_authority_days);
  X509* certificate = out.certificate.get();
  add_extension(certificate, certificate, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  add_extension(certificate, certificate, NID_key_usage, "critical,keyCertSign");
  add_extension(certificate, certificate, NID_subject_key_identifier, "hash");
  add_extension(certificate, certificate, NID_name_constraints, permitted_names(hosts));
  sign(out, certificate);
  return out;
}

Pair make_server_pair(const Pair& authority, const std::vector<std::string>& hosts) {
  Pair out = unsigned_pair("Limn", k_certificate_days);
  X509 *certificate = out.certificate.get(), *issuer = authority.certificate.get();
  add_extension(certificate, issuer, NID_subject_alt_name, alternative_names(hosts));
  add_extension(certificate, issuer, NID_basic_constraints, "critical,CA:FALSE");
  add_extension(certificate, issuer, NID_key_usage, "critical,digitalSignature");
  add_extension(certificate, issuer, NID_ext_key_usage, "serverAuth");
  add_extension(certificate, issuer, NID_authority_key_identifier, "keyid:always");
  sign(authority, certificate);
  return out;
}

bool is_signed_by(const Pair& authority, X509* certificate) {
  const bool is_so = X509_verify(certificate, authority.key.get()) == 1;
  ERR_clear_error();
  return is_so;
}

bool may_sign(const Pair& authority, X509* certificate) {
  const NameConstraints permitted(static_cast<NAME_CONSTRAINTS*>(
      X509_get_ext_d2i(authority.certificate.get(), NID_name_constraints, nullptr, nullptr)));
  X509_check_purpose(certificate, -1, 0);  // parses the names, which the next check needs
  return permitted && NAME_CONSTRAINTS_check(certificate, permitted.get()) == X509_V_OK;
}

std::string pem_of(const Pair& pair, X509* authority = nullptr) {
  const Bio memory(BIO_new(BIO_s_mem()));
  LIMN_CHECK(memory &&
             PEM_write_bio_PrivateKey(memory.get(), pair.key.get(), nullptr, nullptr, 0, nullptr, nullptr) &&
             PEM_write_bio_X509(memory.get(), pair.certificate.get()) &&
             (!authority || PEM_write_bio_X509(memory.get(), authority)));
  char* text = nullptr;
  const long length = BIO_get_mem_data(memory.get(), &text);
  return std::string(text, text + length);
}

std::string der_of(X509* certificate) {
  unsigned char* bytes = nullptr;
  const int length = i2d_X509(certificate, &bytes);
  LIMN_CHECK(length > 0);
  std::string out(bytes, bytes + length);
  OPENSSL_free(bytes);
  return out;
}

Error write_error(const fs::path& path) {
  return error("{}: expected to write here, found: {}. Make the folder writable.", path.string(),
               std::strerror(errno));
}

// As write_file(), but only the owner can ever read the file.
Status write_secret(const fs::path& path, const std::string& content) {
  std::string temporary = path.string() + ".XXXXXX";
  const int handle = ::mkstemp(temporary.data());
  if (handle < 0) return write_error(path);
  bool is_done = ::fchmod(handle, S_IRUSR | S_IWUSR) == 0;
  for (std::size_t at = 0; is_done && at < content.size();) {
    const ssize_t written = ::write(handle, content.data() + at, content.size() - at);
    if (written < 0 && errno == EINTR) continue;
    is_done = written >= 0;
    at += is_done ? static_cast<std::size_t>(written) : 0;
  }
  is_done = is_done && ::fsync(handle) == 0;
  is_done = ::close(handle) == 0 && is_done;
  is_done = is_done && ::rename(temporary.c_str(), path.c_str()) == 0;
  if (is_done) return {};
  const Error problem = write_error(path);
  ::unlink(temporary.c_str());
  return problem;
}

Status check_is_secret(const fs::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return {};
  if ((found.st_mode & (S_IRWXG | S_IRWXO)) == 0 && found.st_uid == ::geteuid()) return {};
  return error(
      "{}: expected a key that its owner alone can read (mode 600), found mode {:o} of user {}. Others may "
      "know it: remove the file, and another one is made.",
      path.string(), found.st_mode & 07777u, found.st_uid);
}

// The key and the certificate of a file; nullopt: there is none.
Result<std::optional<Pair>> read_pair(const fs::path& path) {
  LIMN_TRY_STATUS(check_is_secret(path));
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::optional<Pair>();
  LIMN_TRY(const std::string pem, read_file(path));
  const auto opened = [&] { return Bio(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size()))); };
  Pair found{Key(PEM_read_bio_PrivateKey(opened().get(), nullptr, nullptr, nullptr)),
             X509Certificate(PEM_read_bio_X509(opened().get(), nullptr, nullptr, nullptr))};
  const bool is_pair =
      found.key && found.certificate && X509_check_private_key(found.certificate.get(), found.key.get()) == 1;
  ERR_clear_error();
  if (!is_pair)
    return error(
        "{}: expected a private key and its certificate, found something else. Remove the file, and "
        "another one is made.",
        path.string());
  return std::optional(std::move(found));
}

Certificate certificate_of(const Pair& own, const Pair& authority) {
  X509* signer = authority.certificate.get();
  return {pem_of(own, signer), fingerprint_of(own.certificate.get()), der_of(signer), fingerprint_of(signer)};
}

}  // namespace

Certificate make_certificate(const std::vector<std::string>& hosts) {
  const Pair authority = make_authority(hosts);
  return certificate_of(make_server_pair(authority, hosts), authority);
}

Result<Certificate> load_or_create_certificate(const fs::path& folder,
                                               const std::vector<std::string>& hosts) {
  LIMN_TRY_STATUS(make_folder(folder));
  LIMN_TRY(std::optional<Pair> authority, read_pair(folder / k_authority_file));
  LIMN_TRY(std::optional<Pair> own, read_pair(folder / k_file));
  if (authority && ends_within(k_certificate_days, authority->certificate.get())) authority.reset();
  const bool is_known = authority && own && is_signed_by(*authority, own->certificate.get()) &&
                        is_for_all(own->certificate.get(), hosts) &&
                        !ends_within(k_renewed_days_before, own->certificate.get());
  if (!is_known) {
    if (authority) own = make_server_pair(*authority, hosts);
    if (!authority || !may_sign(*authority, own->certificate.get())) {
      authority = make_authority(hosts);
      own = make_server_pair(*authority, hosts);
      LIMN_TRY_STATUS(write_secret(folder / k_authority_file, pem_of(*authority)));
    }
    LIMN_TRY_STATUS(write_secret(folder / k_file, pem_of(*own)));
  }
  return certificate_of(*own, *authority);
}

}  // namespace limn::remote
