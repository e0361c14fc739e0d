#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::remote {

/// A certificate's life, and how long before its end it is renewed. Phones accept at most 825 days.
constexpr int k_certificate_days = 800, k_renewed_days_before = 30;
/// The life of the authority that signs the certificates. A device that trusts it needs nothing new when the
/// machine gets another address.
constexpr int k_authority_days = 3650;

/// The server's certificate and the authority that signed it.
struct Certificate {
  std::string pem;          ///< Private key (EC P-256), its certificate, the authority's certificate.
  std::string fingerprint;  ///< SHA-256 of the certificate, "AB:CD:…".
  std::string authority;    ///< The authority's certificate (DER), for devices to trust.
  std::string authority_fingerprint;  ///< SHA-256 of the authority's certificate.
};

/// Loads the certificate from `folder`/remote.pem and its authority from `folder`/authority.pem, or makes
/// them: when there is none, when it is not valid for one of the hosts (names and numeric addresses), or when
/// it ends soon. The authority can sign only for private addresses, `.local` and the hosts that it was made
/// for (RFC 5280, 4.2.1.10). A file is written as a whole and can be read by its owner alone. Errors: other
/// users can read a file, or it holds something else.
Result<Certificate> load_or_create_certificate(const std::filesystem::path& folder,
                                               const std::vector<std::string>& hosts);

/// A certificate and an authority that exist in memory alone, for clients that get the fingerprint in another
/// way.
Certificate make_certificate(const std::vector<std::string>& hosts);

}  // namespace limn::remote
