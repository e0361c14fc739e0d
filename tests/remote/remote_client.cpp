#include "tests/remote/remote_client.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>

namespace limn::test {

namespace {

std::string bearer(const std::string& token) {
  return token.empty() ? "" : fmt::format("Authorization: Bearer {}\r\n", token);
}

}  // namespace

struct RemoteClient::Tls {
  SSL_CTX* context = nullptr;
  SSL* session = nullptr;
  ~Tls() {
    SSL_free(session);
    SSL_CTX_free(context);
  }
};

RemoteClient::RemoteClient(int port, bool is_encrypted, const std::string& host, const std::string& from) {
  host_ = fmt::format("{}:{}", host, port);
  const int handle = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  ::inet_pton(AF_INET, host.c_str(), &address.sin_addr);
  sockaddr_in own{};
  own.sin_family = AF_INET;
  ::inet_pton(AF_INET, from.c_str(), &own.sin_addr);
  const timeval patience{10, 0};
  ::setsockopt(handle, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
  if (::bind(handle, reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0 ||
      ::connect(handle, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    ::close(handle);
    return;
  }
  handle_ = handle;
  if (!is_encrypted) return;
  tls_ = std::make_unique<Tls>();
  tls_->context = SSL_CTX_new(TLS_client_method());
  tls_->session = SSL_new(tls_->context);
  SSL_set_fd(tls_->session, handle_);
  if (SSL_connect(tls_->session) == 1) return;
  ERR_clear_error();
  ::close(handle_);
  handle_ = -1;
}

RemoteClient::~RemoteClient() {
  if (handle_ >= 0) ::close(handle_);
}

bool RemoteClient::send(std::string_view bytes) {
  while (handle_ >= 0 && !bytes.empty()) {
    const auto sent = tls_ ? SSL_write(tls_->session, bytes.data(),
                                       static_cast<int>(std::min<std::size_t>(bytes.size(), 16384)))
                           : ::send(handle_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && !tls_ && errno == EINTR) continue;
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  return handle_ >= 0;
}

bool RemoteClient::fill(double patience_s) {
  if (handle_ < 0) return false;
  std::array<char, 65536> bytes{};
  if (!tls_ || SSL_pending(tls_->session) == 0) {
    pollfd wanted{handle_, POLLIN, 0};
    int ready = 0;
    do ready = ::poll(&wanted, 1, static_cast<int>(1e3 * patience_s));
    while (ready < 0 && errno == EINTR);
    if (ready <= 0) return false;
  }
  const auto count = tls_ ? SSL_read(tls_->session, bytes.data(), static_cast<int>(bytes.size()))
                          : ::recv(handle_, bytes.data(), bytes.size(), 0);
  if (count <= 0) return false;
  received_.append(bytes.data(), static_cast<std::size_t>(count));
  return true;
}

std::optional<std::string> RemoteClient::read_bytes(std::size_t count, double patience_s) {
  while (received_.size() < count)
    if (!fill(patience_s)) return std::nullopt;
  std::string out = received_.substr(0, count);
  received_.erase(0, count);
  return out;
}

std::optional<std::string> RemoteClient::take_until(const std::string& end, double patience_s) {
  std::size_t at = received_.find(end);
  while (at == std::string::npos) {
    if (!fill(patience_s)) return std::nullopt;
    at = received_.find(end);
  }
  return read_bytes(at + end.size(), patience_s);
}

RemoteClient::Answer RemoteClient::answer() {
  Answer out;
  const auto head = take_until("\r\n\r\n", 15);
  if (!head || head->size() < 12) return out;
  out.status = std::stoi(head->substr(9, 3));
  for (std::size_t at = head->find("\r\n") + 2; at + 2 < head->size();) {
    const std::size_t end = head->find("\r\n", at), colon = head->find(':', at);
    std::string name = head->substr(at, colon - at);
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    out.headers[name] = head->substr(colon + 2, end - colon - 2);
    at = end + 2;
  }
  if (out.headers.contains("content-length"))
    out.body = read_bytes(std::stoul(out.headers["content-length"]), 15).value_or("");
  return out;
}

RemoteClient::Answer RemoteClient::ask(const std::string& method,
                                       const std::string& target,
                                       const std::string& headers,
                                       const std::string& body) {
  const std::string host =
      headers.find("Host:") == std::string::npos ? fmt::format("Host: {}\r\n", host_) : "";
  const std::string length = method == "POST" && headers.find("Content-Length:") == std::string::npos
                                 ? fmt::format("Content-Length: {}\r\n", body.size())
                                 : "";
  send(fmt::format("{} {} HTTP/1.1\r\n{}{}{}\r\n{}", method, target, host, headers, length, body));
  return answer();
}

RemoteClient::Answer RemoteClient::get(const std::string& target, const std::string& token) {
  return ask("GET", target, bearer(token));
}

RemoteClient::Answer RemoteClient::post(const std::string& target,
                                        const std::string& body,
                                        const std::string& token) {
  const std::string who = bearer(token);
  return ask("POST", target, who + "Content-Type: application/json\r\n", body);
}

RemoteClient::Answer RemoteClient::upgrade(const std::string& token, const std::string& headers) {
  const std::string who = bearer(token);
  return ask("GET", "/api/live",
             who + headers +
                 "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                 "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n");
}

bool RemoteClient::send_half_a_frame(std::size_t length, std::string_view bytes) {
  std::string out = {'\x82', '\xff'};
  for (int shift = 56; shift >= 0; shift -= 8)
    out += static_cast<char>(static_cast<std::uint64_t>(length) >> shift & 0xffu);
  out.append(4, '\0');  // the mask: nothing changes
  return send(out) && send(bytes);
}

bool RemoteClient::send_frame(int kind, std::string_view bytes) {
  std::string out(1, static_cast<char>(0x80 | kind));
  const int width = bytes.size() < 126 ? 0 : bytes.size() < 65536 ? 2 : 8;
  out += static_cast<char>(0x80 | (width == 0 ? static_cast<int>(bytes.size()) : width == 2 ? 126 : 127));
  for (int shift = 8 * (width - 1); shift >= 0; shift -= 8)
    out += static_cast<char>(static_cast<std::uint64_t>(bytes.size()) >> shift & 0xffu);
  out.append(4, '\0');
  return send(out.append(bytes));
}

std::optional<RemoteClient::Message> RemoteClient::message(double patience_s) {
  for (;;) {
    const auto head = read_bytes(2, patience_s);
    if (!head) return std::nullopt;
    const int kind = (*head)[0] & 0x0f;
    std::uint64_t length = static_cast<unsigned char>((*head)[1]) & 0x7fu;
    if (length >= 126) {
      const auto more = read_bytes(length == 126 ? 2 : 8, patience_s);
      if (!more) return std::nullopt;
      length = 0;
      for (const char c : *more) length = length << 8 | static_cast<unsigned char>(c);
    }
    auto bytes = read_bytes(length, patience_s);
    if (!bytes || kind == 8) return std::nullopt;
    if (kind == 9)
      send_frame(10, *bytes);
    else
      return Message{kind == 1, std::move(*bytes)};
  }
}

std::optional<std::string> RemoteClient::message_of(const std::string& type, double patience_s) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(patience_s);
  while (Clock::now() < end) {
    auto next = message(std::chrono::duration<double>(end - Clock::now()).count());
    if (!next) return std::nullopt;
    if (next->is_text && next->bytes.find("\"type\":\"" + type + "\"") != std::string::npos)
      return std::move(next->bytes);
  }
  return std::nullopt;
}

std::string RemoteClient::fingerprint() const {
  X509* certificate = tls_ ? SSL_get1_peer_certificate(tls_->session) : nullptr;
  if (!certificate) return "";
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  X509_digest(certificate, EVP_sha256(), digest.data(), &length);
  X509_free(certificate);
  std::string text;
  for (std::size_t i = 0; i < length; ++i) text += fmt::format("{}{:02X}", i > 0 ? ":" : "", digest[i]);
  return text;
}

void RemoteClient::read_little() {
  const int bytes = 2048;
  ::setsockopt(handle_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
  const timeval patience{1, 0};
  ::setsockopt(handle_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
}

}  // namespace limn::test
