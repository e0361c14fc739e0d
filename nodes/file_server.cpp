#include "nodes/file_server.h"

#include <openssl/crypto.h>

#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include "core/worker_thread.h"
#include "nodes/file_listing.h"
#include "nodes/open_file.h"
#include "nodes/sha256.h"
#include "nodes/token_bucket.h"
#include "remote/http/network.h"
#include "remote/http/own_addresses.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;
using remote::error_response;
using remote::HttpRequest;
using remote::HttpResponse;
using remote::ResponseCallback;

constexpr int k_http_gone = 410;
constexpr int k_token_bits = 128;
constexpr std::string_view k_path = "/files/";
constexpr double k_served_bytes_per_s = 50e6;  // to all nodes: less than half of a gigabit network
constexpr double k_served_burst_bytes = 1e6;

// A file on this machine and what it had in it when it was listed.
struct ListedFile {
  fs::path path;
  std::uint64_t bytes = 0;
  std::vector<std::string> pieces;  // their SHA-256
};

struct ListedPiece {
  fs::path path;
  std::uint64_t offset = 0;
  std::size_t bytes = 0;
  std::string sha256;
};

Error unreadable(const fs::path& path) {
  return error("{}: expected a file that can be read, found: {}.", path.string(), std::strerror(errno));
}

// Reads the file whose size `file` states; sets its SHA-256 and, if it was just written to, its true size.
Result<ListedFile> read_to_list(const fs::path& path, SharedFile* file) {
  OpenFile in = OpenFile::reading(path);
  if (!in.is_open()) return unreadable(path);
  ListedFile out{path, 0, {}};
  Sha256 whole;
  std::string bytes;
  do {
    if (!in.read(out.bytes, k_piece_bytes, &bytes)) return unreadable(path);
    if (bytes.empty()) break;
    whole.add(bytes);
    out.pieces.push_back(sha256_of(bytes));
    out.bytes += bytes.size();
  } while (bytes.size() == k_piece_bytes && out.bytes <= k_max_bytes);
  file->sha256 = whole.digest();
  file->bytes = out.bytes;
  return out;
}

// Sends a piece only if it still is what was listed.
HttpResponse answer_with(const ListedPiece& piece) {
  OpenFile in = OpenFile::reading(piece.path);
  std::string bytes;
  if (!in.is_open() || !in.read(piece.offset, piece.bytes, &bytes) || sha256_of(bytes) != piece.sha256)
    return error_response(k_http_gone, piece.path.filename().string() +
                                           ": the file has changed since the host listed it. Wait for the "
                                           "host's next list.");
  return {200, "application/octet-stream", std::move(bytes), {{"Cache-Control", "no-store"}}};
}

// The SHA-256 and the number of a piece in a request's target.
std::optional<std::pair<std::string, std::uint64_t>> wanted_piece(std::string_view target) {
  if (!target.starts_with(k_path)) return std::nullopt;
  target.remove_prefix(k_path.size());
  const std::size_t slash = std::min(target.find('/'), target.size());
  const std::string_view hash = target.substr(0, slash),
                         number = target.substr(std::min(slash + 1, target.size()));
  std::uint64_t piece = 0;
  const auto [end, problem] = std::from_chars(number.data(), number.data() + number.size(), piece);
  if (!is_sha256(hash) || problem != std::errc() || end != number.data() + number.size()) return std::nullopt;
  return std::pair(std::string(hash), piece);
}

// Answers requests: finds pieces on the network's thread, reads them on a worker.
class FileRequests final : public remote::HttpHandler {
 public:
  void add(std::map<std::string, ListedFile> files) {
    const std::lock_guard lock(mutex_);
    for (auto& [hash, file] : files) files_.insert_or_assign(hash, std::move(file));
  }
  void close() { worker_.close(); }
  const std::string& token() const { return token_; }

  void handle_request(const HttpRequest& request, ResponseCallback respond) override {
    if (!is_allowed(request.authorization)) return respond(refusal());
    if (request.method != "GET")
      return respond(error_response(remote::k_http_method_not_allowed, "expected GET."));
    const std::optional<ListedPiece> piece = find_piece(request.target);
    if (!piece)
      return respond(
          error_response(remote::k_http_not_found, "expected a listed file and one of its pieces."));
    if (!worker_.add_job([this, piece = *piece, respond] {
          const double delay_s = sent_.delay_s(static_cast<double>(piece.bytes), now());
          std::this_thread::sleep_for(std::chrono::duration<double>(delay_s));
          respond(answer_with(piece));
        }))
      respond(error_response(remote::k_http_unavailable, "too many requests wait. Ask again in a moment."));
  }
  std::variant<std::shared_ptr<remote::WebSocketPeer>, HttpResponse> accept_web_socket(
      const HttpRequest& request) override {
    if (!is_allowed(request.authorization)) return refusal();
    return error_response(remote::k_http_not_found, "expected a request for a file.");
  }
  void update_at(std::chrono::steady_clock::time_point) override {}
  void close_clients(const std::string&) override {}
  std::size_t client_count() const override { return 0; }

 private:
  bool is_allowed(const std::string& authorization) const {
    const std::string expected = "Bearer " + token_;
    return authorization.size() == expected.size() &&
           CRYPTO_memcmp(authorization.data(), expected.data(), expected.size()) == 0;
  }
  static HttpResponse refusal() {
    HttpResponse out = error_response(remote::k_http_unauthorized, "expected the token of the host's offer.");
    out.headers.emplace_back("WWW-Authenticate", "Bearer");
    return out;
  }
  std::optional<ListedPiece> find_piece(const std::string& target) {
    const auto wanted = wanted_piece(target);
    if (!wanted) return std::nullopt;
    const auto& [hash, number] = *wanted;
    const std::lock_guard lock(mutex_);
    const auto found = files_.find(hash);
    if (found == files_.end() || number >= found->second.pieces.size()) return std::nullopt;
    const ListedFile& file = found->second;
    return ListedPiece{file.path, number * k_piece_bytes, piece_size(file.bytes, number),
                       file.pieces[number]};
  }

  const std::string token_ = random_secret(k_token_bits);
  TokenBucket sent_{k_served_bytes_per_s, k_served_burst_bytes};  // used by the worker only
  WorkerThread worker_;
  std::mutex mutex_;
  std::map<std::string, ListedFile> files_;  // by SHA-256; the newest place of each content
};

remote::NetworkLimits server_limits() {
  remote::NetworkLimits limits;
  // A node may write to a slow disk between two pieces, and read slowly from a busy network.
  limits.read = limits.write = std::chrono::seconds(60);
  return limits;
}

}  // namespace

struct FileServer::Impl {
  remote::Certificate certificate = remote::make_certificate({"localhost"});
  FileRequests requests;
  std::unique_ptr<remote::Network> network;
};

FileServer::FileServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

FileServer::~FileServer() {
  impl_->network->stop();
  impl_->requests.close();  // before the network is destroyed, which its jobs use
}

Result<std::unique_ptr<FileServer>> FileServer::open() {
  auto impl = std::make_unique<Impl>();
  auto network = remote::Network::open({"::", "0"}, impl->certificate, server_limits());
  if (!network)
    network = remote::Network::open({"0.0.0.0", "0"}, impl->certificate, server_limits());  // without IPv6
  if (!network) return network.error();
  impl->network = std::move(*network);
  impl->network->start(&impl->requests);
  return std::unique_ptr<FileServer>(new FileServer(std::move(impl)));
}

Result<std::vector<SharedFile>> FileServer::share(const fs::path& folder) {
  LIMN_TRY(std::vector<SharedFile> files, list_files(folder));
  std::map<std::string, ListedFile> listed;
  for (SharedFile& file : files) {
    LIMN_TRY(ListedFile read, read_to_list(folder / file.path, &file));
    listed.insert_or_assign(file.sha256, std::move(read));
  }
  LIMN_TRY_STATUS(check_listing(files));
  impl_->requests.add(std::move(listed));
  return files;
}

std::vector<std::string> FileServer::servers() const {
  std::vector<std::string> out;
  std::vector<std::string> addresses = remote::own_addresses_with_link_local();
  addresses.push_back("127.0.0.1");
  for (const std::string& address : addresses)
    out.push_back(address.find(':') == std::string::npos
                      ? fmt::format("{}:{}", address, impl_->network->port())
                      : fmt::format("[{}]:{}", address, impl_->network->port()));
  return out;
}

const std::string& FileServer::fingerprint() const { return impl_->certificate.fingerprint; }

const std::string& FileServer::token() const { return impl_->requests.token(); }

}  // namespace limn::nodes
