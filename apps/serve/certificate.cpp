#include "apps/serve/certificate.h"

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

#include "core/file.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

constexpr const char* k_file = "remote.pem";
constexpr long k_day_s = 24 * 60 * 60;

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

bool is_address(const std::string& host) {
  in6_addr ignored{};
  return inet_pton(AF_INET, host.c_str(), &ignored) == 1 || inet_pton(AF_INET6, host.c_str(), &ignored) == 1;
}

bool is_for(X509* certificate, const std::string& host) {
  return is_address(host) ? X509_check_ip_asc(certificate, host.c_str(), 0) == 1
                          : X509_check_host(certificate, host.data(), host.size(), 0, nullptr) == 1;
}

bool is_for_all(X509* certificate, const std::vector<std::string>& hosts) {
  for (const std::string& host : hosts)
    if (!is_for(certificate, host)) return false;
  return true;
}

bool ends_soon(X509* certificate) {
  std::time_t then = std::time(nullptr) + k_renewed_days_before * k_day_s;
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

void add_extension(X509* certificate, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, certificate, certificate, nullptr, nullptr, 0);
  const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  LIMN_CHECK(extension && X509_add_ext(certificate, extension.get(), -1) == 1);
}

X509Certificate made_for(const std::vector<std::string>& hosts, EVP_PKEY* key) {
  X509Certificate out(X509_new());
  std::array<unsigned char, 16> serial{};
  LIMN_CHECK(out && RAND_bytes(serial.data(), static_cast<int>(serial.size())) == 1);
  serial[0] &= 0x7f;
  const std::unique_ptr<BIGNUM, Free<BN_free>> number(
      BN_bin2bn(serial.data(), static_cast<int>(serial.size()), nullptr));
  LIMN_CHECK(number && BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(out.get())));
  X509_set_version(out.get(), X509_VERSION_3);
  X509_gmtime_adj(X509_getm_notBefore(out.get()), -k_day_s);  // clocks of phones differ
  X509_gmtime_adj(X509_getm_notAfter(out.get()), k_certificate_days * k_day_s);
  X509_NAME* name = X509_get_subject_name(out.get());
  X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC, reinterpret_cast<const unsigned char*>("Limn"), -1, -1,
                             0);
  X509_set_issuer_name(out.get(), name);
  X509_set_pubkey(out.get(), key);
  std::string names;
  for (const std::string& host : hosts)
    names += fmt::format("{}{}:{}", names.empty() ? "" : ",", is_address(host) ? "IP" : "DNS", host);
  add_extension(out.get(), NID_subject_alt_name, names);
  add_extension(out.get(), NID_basic_constraints, "critical,CA:FALSE");
  add_extension(out.get(), NID_key_usage, "critical,digitalSignature");
  add_extension(out.get(), NID_ext_key_usage, "serverAuth");
  LIMN_CHECK(X509_sign(out.get(), key, EVP_sha256()) > 0);
  return out;
}

std::string pem_of(EVP_PKEY* key, X509* certificate) {
  const Bio memory(BIO_new(BIO_s_mem()));
  LIMN_CHECK(memory && PEM_write_bio_PrivateKey(memory.get(), key, nullptr, nullptr, 0, nullptr, nullptr) &&
             PEM_write_bio_X509(memory.get(), certificate));
  char* text = nullptr;
  const long length = BIO_get_mem_data(memory.get(), &text);
  return std::string(text, text + length);
}

Error write_error(const fs::path& path) {
  return error("{}: expected to write here, found: {}. Make the folder writable.", path.string(),
               std::strerror(errno));
}

// As write_file(), but from the first moment for its owner alone.
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

struct Found {
  Key key;
  X509Certificate certificate;
};

Result<Found> read_from(const fs::path& path) {
  LIMN_TRY(const std::string pem, read_file(path));
  const auto opened = [&] { return Bio(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size()))); };
  Found found{Key(PEM_read_bio_PrivateKey(opened().get(), nullptr, nullptr, nullptr)),
              X509Certificate(PEM_read_bio_X509(opened().get(), nullptr, nullptr, nullptr))};
  ERR_clear_error();
  if (!found.key || !found.certificate ||
      X509_check_private_key(found.certificate.get(), found.key.get()) != 1) {
    ERR_clear_error();
    return error(
        "{}: expected a private key and its certificate, found something else. Remove the file, and "
        "another one is made.",
        path.string());
  }
  return found;
}

}  // namespace

Result<fs::path> own_folder() {
  const char* config = std::getenv("XDG_CONFIG_HOME");
  if (config && fs::path(config).is_absolute()) return fs::path(config) / "limn";
  const char* home = std::getenv("HOME");
  if (home && *home) return fs::path(home) / ".config" / "limn";
  return error(
      "expected a folder for what Limn keeps of guests, found neither XDG_CONFIG_HOME nor HOME. Set one.");
}

Result<Certificate> certificate_in(const fs::path& folder, const std::vector<std::string>& hosts) {
  const fs::path path = folder / k_file;
  LIMN_TRY_STATUS(make_folder(folder));
  LIMN_TRY_STATUS(check_is_secret(path));
  std::error_code ignored;
  if (fs::exists(path, ignored)) {
    LIMN_TRY(const Found found, read_from(path));
    X509* certificate = found.certificate.get();
    if (is_for_all(certificate, hosts) && !ends_soon(certificate))
      return Certificate{pem_of(found.key.get(), certificate), fingerprint_of(certificate)};
  }
  const Key key(EVP_EC_gen("P-256"));
  LIMN_CHECK(key != nullptr);
  const X509Certificate certificate = made_for(hosts, key.get());
  const std::string pem = pem_of(key.get(), certificate.get());
  LIMN_TRY_STATUS(write_secret(path, pem));
  return Certificate{pem, fingerprint_of(certificate.get())};
}

}  // namespace limn::apps
