// The remote's certificate and its authority, judged as a device does that trusts the authority alone.
#include "remote/http/certificate.h"

#include <gtest/gtest.h>
#include <openssl/pem.h>
#include <openssl/x509_vfy.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>

#include <filesystem>
#include <memory>
#include <regex>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;

// What a device says of a server that shows `pem` as `host`, when it trusts the authority of `trusted` and
// nothing else: X509_V_OK or the reason.
int trusting(const Certificate& trusted, const std::string& pem, const std::string& host) {
  const auto* der = reinterpret_cast<const unsigned char*>(trusted.authority.data());
  const std::unique_ptr<X509, decltype(&X509_free)> root(
      d2i_X509(nullptr, &der, static_cast<long>(trusted.authority.size())), X509_free);
  const std::unique_ptr<BIO, decltype(&BIO_free)> text(
      BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())), BIO_free);
  const std::unique_ptr<X509, decltype(&X509_free)> shown(
      PEM_read_bio_X509(text.get(), nullptr, nullptr, nullptr), X509_free);
  const std::unique_ptr<X509_STORE, decltype(&X509_STORE_free)> store(X509_STORE_new(), X509_STORE_free);
  X509_STORE_add_cert(store.get(), root.get());
  const std::unique_ptr<X509_STORE_CTX, decltype(&X509_STORE_CTX_free)> check(X509_STORE_CTX_new(),
                                                                              X509_STORE_CTX_free);
  X509_STORE_CTX_init(check.get(), store.get(), shown.get(), nullptr);
  X509_VERIFY_PARAM* rules = X509_STORE_CTX_get0_param(check.get());
  X509_VERIFY_PARAM_set_purpose(rules, X509_PURPOSE_SSL_SERVER);
  X509_VERIFY_PARAM_set_flags(rules, X509_V_FLAG_X509_STRICT);
  if (X509_VERIFY_PARAM_set1_ip_asc(rules, host.c_str()) != 1)
    X509_VERIFY_PARAM_set1_host(rules, host.data(), host.size());
  X509_verify_cert(check.get());
  return X509_STORE_CTX_get_error(check.get());
}

TEST(Certificate, IsMadeOnceForItsOwnerAlone) {
  const fs::path all = test::test_folder(), folder = all / "limn", file = folder / "remote.pem";
  const auto first = load_or_create_certificate(folder, {"localhost", "192.168.7.2"});
  ASSERT_TRUE(first) << first.message();
  for (const char* name : {"remote.pem", "authority.pem"}) {
    struct stat found {};
    ASSERT_EQ(::stat((folder / name).c_str(), &found), 0);
    EXPECT_EQ(found.st_mode & 07777u, 0600u) << name;
  }
  EXPECT_TRUE(std::regex_match(first->fingerprint, std::regex("([0-9A-F]{2}:){31}[0-9A-F]{2}")));
  EXPECT_EQ(load_or_create_certificate(folder, {"192.168.7.2"})->fingerprint, first->fingerprint)
      << "known already";
  const auto other = load_or_create_certificate(folder, {"192.168.7.3", "fe80::1"});
  ASSERT_TRUE(other);
  EXPECT_NE(other->fingerprint, first->fingerprint) << "another host";
  EXPECT_EQ(other->authority, first->authority) << "devices that trust it trust the new address, too";
  int files = 0;
  for ([[maybe_unused]] const auto& each : fs::directory_iterator(folder)) ++files;
  EXPECT_EQ(files, 2) << "temporary files stay";

  ::chmod(file.c_str(), 0640);
  const auto readable = load_or_create_certificate(folder, {"192.168.7.3"});
  ASSERT_FALSE(readable);
  EXPECT_NE(readable.message().find("found mode 640"), std::string::npos) << readable.message();
  ::chmod(file.c_str(), 0600);
  for (const char* name : {"remote.pem", "authority.pem"}) {
    const std::string kept = read_file(folder / name).value();
    ASSERT_TRUE(write_file(folder / name, "something else"));
    ::chmod((folder / name).c_str(), 0600);
    const auto broken = load_or_create_certificate(folder, {"192.168.7.3"});
    ASSERT_FALSE(broken) << name;
    EXPECT_NE(broken.message().find(name), std::string::npos) << broken.message();
    EXPECT_NE(broken.message().find("expected a private key"), std::string::npos) << broken.message();
    ASSERT_TRUE(write_file(folder / name, kept));
    ::chmod((folder / name).c_str(), 0600);
  }
  // Another's certificate, or one from before there was an authority.
  ASSERT_TRUE(load_or_create_certificate(all / "another", {"192.168.7.3", "fe80::1"}));
  fs::copy_file(all / "another/remote.pem", file, fs::copy_options::overwrite_existing);
  const auto again = load_or_create_certificate(folder, {"192.168.7.3"});
  ASSERT_TRUE(again) << again.message();
  EXPECT_EQ(again->authority, first->authority);
  EXPECT_EQ(trusting(*first, again->pem, "192.168.7.3"), X509_V_OK);
}

TEST(Certificate, IsBelievedByWhoTrustsItsAuthorityAndByNobodyElse) {
  const auto made =
      load_or_create_certificate(test::test_folder() / "limn", {"localhost", "192.168.7.2", "studio.local"});
  const auto another = load_or_create_certificate(test::test_folder() / "another", {"192.168.7.2"});
  ASSERT_TRUE(made && another);
  for (const char* host : {"localhost", "192.168.7.2", "studio.local"})
    EXPECT_EQ(trusting(*made, made->pem, host), X509_V_OK) << host;
  EXPECT_EQ(trusting(*made, made->pem, "192.168.7.9"), X509_V_ERR_IP_ADDRESS_MISMATCH);
  EXPECT_NE(trusting(*another, made->pem, "192.168.7.2"), X509_V_OK);
}

TEST(Certificate, OfAnAddressThatAnyoneReachesHasAnAuthorityThatMaySpeakForIt) {
  const fs::path folder = test::test_folder() / "limn";
  const auto of_office = load_or_create_certificate(folder, {"10.0.0.5"});
  const auto of_campus =
      load_or_create_certificate(folder, {"203.0.113.5", "2001:db8::5", "lab.example.org"});
  ASSERT_TRUE(of_office && of_campus);
  EXPECT_NE(of_campus->authority, of_office->authority) << "the first one may not speak for it";
  for (const char* host : {"203.0.113.5", "2001:db8::5", "lab.example.org"})
    EXPECT_EQ(trusting(*of_campus, of_campus->pem, host), X509_V_OK) << host;
  const auto back = load_or_create_certificate(folder, {"10.0.0.5"});
  ASSERT_TRUE(back);
  EXPECT_EQ(back->authority, of_campus->authority);
  EXPECT_EQ(trusting(*back, back->pem, "10.0.0.5"), X509_V_OK);
}

}  // namespace
}  // namespace limn::remote
