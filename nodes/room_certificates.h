#pragma once

#include <ctime>
#include <string>

#include "core/result.h"
#include "nodes/room_keys.h"

namespace limn::nodes {

/// The content of a new room's files, without the authority's private key.
struct RoomFiles {
  std::string authority;                ///< PEM
  std::string host, node;               ///< a private key and its certificate, PEM
  std::string governance, permissions;  ///< S/MIME, signed by the authority
};

/// Makes the keys of a room (elliptic curve P-256), valid from a day before `now` for k_room_years.
RoomFiles make_room_files(const std::string& name, std::time_t now);

/// A room's name, and the private key and certificate of a file with both.
struct RoomIdentity {
  std::string name, certificate, private_key;
};
/// Checks a key and its certificate at a moment: they belong together, the authority signed the certificate,
/// and it is valid then. `where` names the file in errors.
Result<RoomIdentity> read_identity(const std::string& pem,
                                   const std::string& authority,
                                   const std::string& where,
                                   std::time_t now);

/// Whether the authority signed an S/MIME document. `where` names its file in the error.
Status check_document(const std::string& document, const std::string& authority, const std::string& where);

}  // namespace limn::nodes
