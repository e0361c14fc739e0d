#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace limn::test {

/// A guest of the remote, by hand: bytes over a socket, so that wrong ones can be sent, too. Reads wait for
/// `patience_s` at most.
class RemoteClient {
 public:
  struct Answer {
    int status = 0;                              ///< 0: the connection ended instead
    std::map<std::string, std::string> headers;  ///< names in lower case
    std::string body;
  };
  struct Message {
    bool is_text = true;
    std::string bytes;
  };

  /// `from`: the address of this machine that it connects from.
  explicit RemoteClient(int port,
                        bool is_encrypted = false,
                        const std::string& host = "127.0.0.1",
                        const std::string& from = "0.0.0.0");
  RemoteClient(const RemoteClient&) = delete;
  RemoteClient& operator=(const RemoteClient&) = delete;
  ~RemoteClient();  ///< vanishes without a word

  bool is_connected() const { return handle_ >= 0; }
  bool send(std::string_view bytes);
  Answer answer();
  /// A request of HTTP 1.1; Host is right unless `headers` have one.
  Answer ask(const std::string& method,
             const std::string& target,
             const std::string& headers = "",
             const std::string& body = "");
  Answer get(const std::string& target, const std::string& token = "");
  Answer post(const std::string& target, const std::string& body, const std::string& token = "");

  /// Becomes a WebSocket; status 101 when it did.
  Answer upgrade(const std::string& token, const std::string& headers = "");
  bool send_text(std::string_view text) { return send_frame(1, text); }
  bool send_binary(std::string_view bytes) { return send_frame(2, bytes); }
  /// The beginning of a message of that length, and no more.
  bool send_half_a_frame(std::size_t length, std::string_view bytes);
  /// The next message; pings are answered. nullopt: the connection ended or nothing came in time.
  std::optional<Message> message(double patience_s = 5);
  /// The next text message that has "type": type.
  std::optional<std::string> message_of(const std::string& type, double patience_s = 5);

  /// The certificate's SHA-256, "AB:CD:…".
  std::string fingerprint() const;
  /// Becomes a slow reader: little waits to be read, and what it cannot send within a second it does not.
  void read_little();

 private:
  struct Tls;
  bool send_frame(int kind, std::string_view bytes);
  bool fill(double patience_s);
  std::optional<std::string> read_bytes(std::size_t count, double patience_s);
  std::optional<std::string> take_until(const std::string& end, double patience_s);

  int handle_ = -1;
  std::string host_;
  std::string received_;
  std::unique_ptr<Tls> tls_;
};

}  // namespace limn::test
