#include "nodes/file_client.h"

#include <net/if.h>
#include <openssl/ssl.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <cctype>
#include <chrono>
#include <thread>
#include <vector>

#include "device/udp_socket.h"
#include "nodes/file_listing.h"
#include "remote/http/http.h"
#include "remote/http/x509.h"

namespace limn::nodes {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using SteadyClock = std::chrono::steady_clock;
using Problem = beast::error_code;

constexpr std::chrono::milliseconds k_connect_limit{1000};   // for one address
constexpr std::chrono::milliseconds k_progress_limit{5000};  // without a byte
constexpr std::chrono::milliseconds k_piece_limit{60000};    // for one piece, which may come byte by byte
constexpr std::chrono::milliseconds k_busy_limit{5000}, k_busy_pause{100};    // while the host answers 503
constexpr double k_fetched_bytes_per_s = 9e6, k_fetched_burst_bytes = 0.5e6;  // 30 MB in 3.3 s
constexpr std::size_t k_max_servers = 32;  // a machine has few addresses; each may cost k_connect_limit

struct FreeInterfaceNames {
  void operator()(struct if_nameindex* names) const { ::if_freenameindex(names); }
};

// An address as endpoints: a link-local one of IPv6 may be behind any of this machine's interfaces.
std::vector<tcp::endpoint> endpoints_of(const std::string& server) {
  const auto place = device::net_place(server, "");
  Problem problem;
  if (!place) return {};
  const auto address = asio::ip::make_address(place->host, problem);
  if (problem) return {};
  const auto port = static_cast<unsigned short>(std::stoi(place->port));
  if (!address.is_v6() || !address.to_v6().is_link_local() || address.to_v6().scope_id() != 0)
    return {tcp::endpoint(address, port)};
  std::vector<tcp::endpoint> out;
  const std::unique_ptr<struct if_nameindex, FreeInterfaceNames> names(::if_nameindex());
  for (const auto* at = names.get(); at && at->if_index != 0; ++at) {
    asio::ip::address_v6 scoped = address.to_v6();
    scoped.scope_id(at->if_index);
    out.emplace_back(scoped, port);
  }
  return out;
}

std::string certificate_of_peer(SSL* session) {
  const remote::X509Certificate shown(SSL_get1_peer_certificate(session));
  return shown ? remote::fingerprint_of(shown.get()) : std::string();
}

std::string text_of_problem(const Problem& problem) {
  if (problem == beast::error::timeout) return "no answer in time";
  if (problem == http::error::end_of_stream || problem == http::error::partial_message ||
      problem == asio::error::eof || problem == asio::ssl::error::stream_truncated)
    return "the connection ended";
  return problem.message();
}

// A host's token is part of a header.
bool is_token(const std::string& text) {
  return std::all_of(text.begin(), text.end(),
                     [](char c) { return std::isxdigit(static_cast<unsigned char>(c)) != 0; });
}

struct PieceAnswer {
  int status = 0;
  std::string body;
  bool keeps_alive = false;
};

Error refusal_by_host(const std::string& server, const PieceAnswer& answer) {
  if (answer.status == remote::k_http_unauthorized)
    return error(
        "{}: expected the session's files, found that the host refuses this machine's token. Wait for "
        "the host's next offer, or start limn node again.",
        server);
  return error("{}: expected one of the session's files, found: HTTP {}, {}", server, answer.status,
               answer.body.substr(0, 300));
}

}  // namespace

// One connection. Each step runs until it is done or its time is over.
struct FileClient::Connection {
  asio::io_context io{1};
  asio::ssl::context tls{asio::ssl::context::tls_client};
  beast::ssl_stream<beast::tcp_stream> stream;
  beast::flat_buffer buffer;
  std::string server;

  explicit Connection(std::string name) : stream(io, with_rules(&tls)), server(std::move(name)) {}

  // The fingerprint is checked instead of a chain of authorities.
  static asio::ssl::context& with_rules(asio::ssl::context* tls) {
    tls->set_verify_mode(asio::ssl::verify_none);
    SSL_CTX_set_min_proto_version(tls->native_handle(), TLS1_2_VERSION);
    return *tls;
  }

  template <class Start>
  Problem finish_step(SteadyClock::duration limit, Start start) {
    Problem result = asio::error::would_block;
    beast::get_lowest_layer(stream).expires_after(limit);
    start([&result](Problem problem, auto&&...) { result = problem; });
    io.restart();
    io.run();
    return result;
  }

  // Text: why not; empty: it is connected to the host.
  std::string open(const tcp::endpoint& endpoint, const std::string& fingerprint) {
    Problem problem = finish_step(k_connect_limit, [&](auto done) {
      beast::get_lowest_layer(stream).async_connect(endpoint, std::move(done));
    });
    if (problem) return text_of_problem(problem);
    beast::get_lowest_layer(stream).socket().set_option(tcp::no_delay(true), problem);
    problem = finish_step(k_progress_limit, [&](auto done) {
      stream.async_handshake(asio::ssl::stream_base::client, std::move(done));
    });
    if (problem) return text_of_problem(problem);
    const std::string shown = certificate_of_peer(stream.native_handle());
    if (shown.empty() || shown != fingerprint)
      return fmt::format("another certificate ({}) than the host's", shown.substr(0, 11));
    return "";
  }

  // Sends a request and reads its answer.
  Problem ask(const std::string& target, const std::string& token, PieceAnswer* answer) {
    http::request<http::empty_body> request(http::verb::get, target, 11);
    request.set(http::field::host, server);
    request.set(http::field::authorization, "Bearer " + token);
    Problem problem = finish_step(k_progress_limit,
                                  [&](auto done) { http::async_write(stream, request, std::move(done)); });
    http::response_parser<http::string_body> parser;
    parser.body_limit(k_piece_bytes);
    const auto end = SteadyClock::now() + k_piece_limit;
    while (!problem && !parser.is_done()) {
      const auto limit = std::min<SteadyClock::duration>(k_progress_limit, end - SteadyClock::now());
      problem = finish_step(
          limit, [&](auto done) { http::async_read_some(stream, buffer, parser, std::move(done)); });
    }
    if (problem) return problem;
    answer->keeps_alive = parser.get().keep_alive();
    answer->status = static_cast<int>(parser.get().result_int());
    answer->body = std::move(parser.get().body());
    return {};
  }
};

FileClient::FileClient(const Offer& host)
    : host_(host), received_(k_fetched_bytes_per_s, k_fetched_burst_bytes) {}

FileClient::~FileClient() = default;

Status FileClient::connect() {
  std::string problems;
  const std::size_t count = std::min(host_.servers.size(), k_max_servers);
  for (std::size_t i = 0; i < count; ++i) {
    const std::string& server = host_.servers[i];
    const auto endpoints = endpoints_of(server);
    if (endpoints.empty()) problems += fmt::format("; {}: not an address with a port", server);
    for (const tcp::endpoint& endpoint : endpoints) {
      auto connection = std::make_unique<Connection>(server);
      const std::string problem = connection->open(endpoint, host_.fingerprint);
      if (problem.empty()) {
        connection_ = std::move(connection);
        return {};
      }
      problems += fmt::format("; {}: {}", server, problem);
    }
  }
  return error(
      "the host's files: expected its server at one of its addresses, found {}. Check that the host runs, "
      "that "
      "its addresses can be reached from here, and that no firewall blocks the port.",
      problems.empty() ? "no address in its offer" : problems.substr(2));
}

Result<std::string> FileClient::fetch_piece(const std::string& target) {
  const auto end = SteadyClock::now() + k_busy_limit;
  bool has_failed = false;
  for (;;) {
    if (!connection_) {
      LIMN_TRY_STATUS(connect());
    }
    const std::string server = connection_->server;
    PieceAnswer answer;
    const Problem problem = connection_->ask(target, host_.token, &answer);
    if (problem || !answer.keeps_alive) connection_.reset();
    if (problem) {
      // The server closes a connection that was idle for long.
      if (has_failed || problem == beast::error::timeout)
        return error(
            "{}: expected the rest of the session's files, found: {}. Check the network and that the "
            "host still runs.",
            server, text_of_problem(problem));
      has_failed = true;
    } else if (answer.status == 200) {
      return std::move(answer.body);
    } else if (answer.status != remote::k_http_unavailable || SteadyClock::now() > end) {
      return refusal_by_host(server, answer);
    } else {
      std::this_thread::sleep_for(k_busy_pause);
    }
  }
}

Status FileClient::fetch_file(const SharedFile& file,
                              const std::function<Status(std::string_view)>& write) try {
  if (!is_token(host_.token))
    return error("the host's files: expected a token in its offer, found another text.");
  for (std::uint64_t piece = 0; piece < piece_count(file.bytes); ++piece) {
    const double delay_s = received_.delay_s(static_cast<double>(piece_size(file.bytes, piece)), now());
    std::this_thread::sleep_for(std::chrono::duration<double>(delay_s));
    LIMN_TRY(const std::string bytes, fetch_piece(fmt::format("/files/{}/{}", file.sha256, piece)));
    if (bytes.size() != piece_size(file.bytes, piece))
      return error("the session's file {}: expected {} bytes, found {}. Wait for the host's next list.",
                   file.path, piece_size(file.bytes, piece), bytes.size());
    LIMN_TRY_STATUS(write(bytes));
  }
  return {};
} catch (const boost::system::system_error& problem) {
  return error("the host's files: cannot open a connection: {}.", problem.what());
}

}  // namespace limn::nodes
