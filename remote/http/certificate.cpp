#include "remote/http/certificate.h"

#include <arpa/inet.h>
#include <openssl/err.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <optional>

#include "core/file.h"
#include "device/udp_socket.h"
#include "remote/http/own_addresses.h"
#include "remote/http/x509.h"

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

using NameConstraints = std::unique_ptr<NAME_CONSTRAINTS, FreeOpenSsl<NAME_CONSTRAINTS_free>>;

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

KeyPair named_pair(const std::string& name, int days) {
  const std::pair<const char*, std::string> subject{"CN", name};
  const std::time_t now = std::time(nullptr);
  return unsigned_pair({&subject, 1}, now - k_day_s, now + days * k_day_s);  // phones' clocks may be slow
}

KeyPair make_authority(const std::vector<std::string>& hosts) {
  constexpr std::size_t k_most = 40;  // letters of the machine's name; a certificate's name has 64 at most
  const std::string machine = own_host_name().substr(0, k_most);
  KeyPair out = named_pair(machine.empty() ? "Limn" : "Limn on " + machine, k_authority_days);
  X509* certificate = out.certificate.get();
  add_extension(certificate, certificate, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  add_extension(certificate, certificate, NID_key_usage, "critical,keyCertSign");
  add_extension(certificate, certificate, NID_subject_key_identifier, "hash");
  add_extension(certificate, certificate, NID_name_constraints, permitted_names(hosts));
  sign(out, certificate);
  return out;
}

KeyPair make_server_pair(const KeyPair& authority, const std::vector<std::string>& hosts) {
  KeyPair out = named_pair("Limn", k_certificate_days);
  X509 *certificate = out.certificate.get(), *issuer = authority.certificate.get();
  add_extension(certificate, issuer, NID_subject_alt_name, alternative_names(hosts));
  add_extension(certificate, issuer, NID_basic_constraints, "critical,CA:FALSE");
  add_extension(certificate, issuer, NID_key_usage, "critical,digitalSignature");
  add_extension(certificate, issuer, NID_ext_key_usage, "serverAuth");
  add_extension(certificate, issuer, NID_authority_key_identifier, "keyid:always");
  sign(authority, certificate);
  return out;
}

bool is_signed_by(const KeyPair& authority, X509* certificate) {
  const bool is_so = X509_verify(certificate, authority.key.get()) == 1;
  ERR_clear_error();
  return is_so;
}

bool may_sign(const KeyPair& authority, X509* certificate) {
  const NameConstraints permitted(static_cast<NAME_CONSTRAINTS*>(
      X509_get_ext_d2i(authority.certificate.get(), NID_name_constraints, nullptr, nullptr)));
  X509_check_purpose(certificate, -1, 0);  // parses the names, which the next check needs
  return permitted && NAME_CONSTRAINTS_check(certificate, permitted.get()) == X509_V_OK;
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
Result<std::optional<KeyPair>> read_pair(const fs::path& path) {
  LIMN_TRY_STATUS(check_is_secret(path));
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::optional<KeyPair>();
  LIMN_TRY(const std::string pem, read_file(path));
  KeyPair found{key_in(pem), certificate_in(pem)};
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

Certificate certificate_of(const KeyPair& own, const KeyPair& authority) {
  X509* signer = authority.certificate.get();
  return {pem_of(own) + pem_of(signer), fingerprint_of(own.certificate.get()), der_of(signer),
          fingerprint_of(signer)};
}

}  // namespace

Certificate make_certificate(const std::vector<std::string>& hosts) {
  const KeyPair authority = make_authority(hosts);
  return certificate_of(make_server_pair(authority, hosts), authority);
}

Result<Certificate> load_or_create_certificate(const fs::path& folder,
                                               const std::vector<std::string>& hosts) {
  LIMN_TRY_STATUS(make_folder(folder));
  LIMN_TRY(std::optional<KeyPair> authority, read_pair(folder / k_authority_file));
  LIMN_TRY(std::optional<KeyPair> own, read_pair(folder / k_file));
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
