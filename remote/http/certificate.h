#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::remote {

/// How long a certificate is good for, and when before its end another one is made. Phones take no more than
/// 825 days.
constexpr int k_certificate_days = 800, k_renewed_days_before = 30;
/// How long the authority is good for that signs them: devices that trust it need not be asked again when a
/// machine gets another address.
constexpr int k_authority_days = 3650;

/// What the server shows itself with.
struct Certificate {
  std::string pem;                    ///< private key (EC P-256), its certificate, then that of the authority
  std::string fingerprint;            ///< SHA-256 of the certificate, "AB:CD:…"
  std::string authority;              ///< the authority's certificate (DER), for devices that shall trust it
  std::string authority_fingerprint;  ///< SHA-256 of that
};

/// The certificate in `folder`/remote.pem, for these hosts (names and numeric addresses), signed by the
/// authority in `folder`/authority.pem, which can speak for private addresses, `.local` and hosts that it was
/// made for alone (RFC 5280, 4.2.1.10). Each is made when there is none, when it is not for one of the hosts,
/// or when it ends soon; a file then is either old or complete, and nobody but its owner can read it. Error:
/// somebody else can, or a file holds something else.
Result<Certificate> load_or_create_certificate(const std::filesystem::path& folder,
                                               const std::vector<std::string>& hosts);

}  // namespace limn::remote
