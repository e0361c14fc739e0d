#include "remote/http/network.h"

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <map>
#include <thread>

#include "core/log.h"
#include "core/worker_thread.h"
#include "device/udp_socket.h"
#include "remote/http/own_addresses.h"

namespace limn::remote {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using Problem = beast::error_code;

constexpr auto k_tick = std::chrono::milliseconds(25);
constexpr auto k_close_timeout = std::chrono::milliseconds(400);  // for last messages, when the server stops
constexpr auto k_accept_retry = std::chrono::milliseconds(100);   // when no file handles are left
constexpr int k_nice = 5;                                         // the projectors' threads have priority
constexpr std::size_t k_chunk = 16 * 1024;               // bytes read at once while a connection is drained
constexpr std::size_t k_max_drained = 32 * 1024 * 1024;  // bytes

using PlainStream = beast::tcp_stream;
using TlsStream = beast::ssl_stream<beast::tcp_stream>;

template <class Stream>
constexpr bool k_is_tls = std::is_same_v<Stream, TlsStream>;

// Counts connections, by address, and grants or refuses new ones. When all slots are taken, a connection that
// has not sent a whole request makes room for one from an address with fewer connections.
class ConnectionSlots {
 public:
  explicit ConnectionSlots(const NetworkLimits& limits) : limits_(limits) {}

  enum class Kind { served, rejected };
  // One granted connection; its destructor gives the slot back.
  class Slot {
   public:
    Slot(ConnectionSlots* slots, std::string address, Kind kind)
        : slots_(slots), address_(std::move(address)), kind_(kind) {
      slots_->count(address_, kind_, 1);
    }
    Slot(const Slot&) = delete;
    Slot& operator=(const Slot&) = delete;
    ~Slot() {
      set_busy();
      if (!is_evicted_) slots_->count(address_, kind_, -1);
    }
    const std::string& address() const { return address_; }
    Kind kind() const { return kind_; }

    // The connection waits for a request; `close` closes it.
    void set_waiting(std::function<void()> close) {
      if (kind_ != Kind::served || is_evicted_) return;
      set_busy();
      waiting_number_ = ++slots_->last_waiting_;
      close_ = std::move(close);
      slots_->waiting_.emplace(waiting_number_, this);
    }
    // A request arrived, or the connection became a WebSocket: it is not closed for another one.
    void set_busy() { slots_->waiting_.erase(waiting_number_); }

   private:
    friend class ConnectionSlots;
    ConnectionSlots* slots_;
    std::string address_;
    Kind kind_;
    std::uint64_t waiting_number_ = 0;
    std::function<void()> close_;
    bool is_evicted_ = false;
  };

  // Null: there is no slot left, not even for an answer that says so.
  std::unique_ptr<Slot> acquire(const std::string& address) {
    const bool is_over_limit =
        !device::is_loopback(address) && connections_of(address) >= static_cast<int>(limits_.per_address);
    if (!is_over_limit && (has_room() || evict_for(address)))
      return std::make_unique<Slot>(this, address, Kind::served);
    if (rejected_ >= static_cast<int>(limits_.rejected)) return nullptr;
    return std::make_unique<Slot>(this, address, Kind::rejected);
  }

 private:
  bool has_room() const { return served_ < static_cast<int>(limits_.connections); }

  int connections_of(const std::string& address) const {
    const auto at = per_address_.find(address);
    return at == per_address_.end() ? 0 : at->second;
  }

  // Closes the connection that has waited longest of the address with the most connections, if it has more
  // than this address. Returns whether there is room.
  bool evict_for(const std::string& address) {
    const auto most = std::max_element(waiting_.begin(), waiting_.end(), [&](const auto& a, const auto& b) {
      return connections_of(a.second->address()) < connections_of(b.second->address());
    });
    if (most == waiting_.end() || connections_of(most->second->address()) <= connections_of(address))
      return false;
    Slot* const slot = most->second;
    slot->set_busy();
    slot->is_evicted_ = true;
    count(slot->address(), Kind::served, -1);
    slot->close_();
    return has_room();
  }

  void count(const std::string& address, Kind kind, int change) {
    if (kind == Kind::rejected) {
      rejected_ += change;
      return;
    }
    served_ += change;
    if ((per_address_[address] += change) == 0) per_address_.erase(address);
  }

  NetworkLimits limits_;
  int served_ = 0, rejected_ = 0;
  std::map<std::string, int> per_address_;
  std::map<std::uint64_t, Slot*> waiting_;  // in the order in which they began to wait
  std::uint64_t last_waiting_ = 0;
};

// What all connections share.
struct SharedState {
  asio::io_context io{1};
  std::optional<asio::ssl::context> tls;
  NetworkLimits limits;
  HttpHandler* handler = nullptr;
  bool is_closing = false;

  // Connections that wait for an answer. Other threads hold only a number, so that a connection is used and
  // destroyed on the network's thread alone.
  std::map<std::uint64_t, ResponseCallback> waiting;
  std::uint64_t last_waiting = 0;

  // The same function for any thread: it runs `respond` on the network's thread.
  ResponseCallback on_network_thread(ResponseCallback respond) {
    waiting.emplace(++last_waiting, std::move(respond));
    return [this, number = last_waiting](HttpResponse response) {
      asio::post(io, [this, number, response = std::move(response)]() mutable {
        const auto found = waiting.extract(number);
        if (!found.empty()) found.mapped()(std::move(response));
      });
    };
  }
};

// Closes a connection so that the last answer arrives: what the other side still sends is read for a moment
// and dropped. (A socket that is closed with unread bytes resets the connection.)
class DrainedClose : public std::enable_shared_from_this<DrainedClose> {
 public:
  DrainedClose(beast::tcp_stream stream, std::unique_ptr<ConnectionSlots::Slot> slot)
      : stream_(std::move(stream)), slot_(std::move(slot)) {}

  void run(std::chrono::milliseconds time) {
    Problem ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    stream_.expires_after(time);
    read();
  }

 private:
  void read() {
    stream_.async_read_some(asio::buffer(bytes_),
                            [self = shared_from_this()](Problem problem, std::size_t count) {
                              self->drained_ += count;
                              if (!problem && self->drained_ < k_max_drained) self->read();
                            });
  }

  beast::tcp_stream stream_;
  std::unique_ptr<ConnectionSlots::Slot> slot_;
  std::array<char, k_chunk> bytes_{};
  std::size_t drained_ = 0;
};

// A guest's WebSocket. One message is written at a time; the peer keeps what comes next.
template <class Stream>
class Socket : public std::enable_shared_from_this<Socket<Stream>> {
 public:
  Socket(Stream stream,
         SharedState* shared,
         std::unique_ptr<ConnectionSlots::Slot> slot,
         std::shared_ptr<WebSocketPeer> peer)
      : socket_(std::move(stream)),
        shared_(shared),
        slot_(std::move(slot)),
        peer_(std::move(peer)),
        timeout_(shared->io) {}

  template <class Request>
  void run(const Request& request) {
    beast::get_lowest_layer(socket_).expires_never();  // the WebSocket has its own limits
    websocket::stream_base::timeout limits{shared_->limits.read, shared_->limits.silence, true};
    socket_.set_option(limits);
    socket_.auto_fragment(false);
    socket_.read_message_max(peer_->longest_message());
    socket_.async_accept(request, [self = this->shared_from_this()](Problem problem) {
      if (problem) return;
      self->peer_->open([weak = self->weak_from_this()] {
        if (const auto self = weak.lock()) self->write();
      });
      self->read();
    });
  }

 private:
  void read() {
    socket_.async_read(buffer_, [self = this->shared_from_this()](Problem problem, std::size_t) {
      if (problem) return self->end();
      self->receive();
      self->read();
    });
  }

  void receive() {
    const auto bytes = buffer_.cdata();
    const auto* data = static_cast<const char*>(bytes.data());
    if (socket_.got_text())
      peer_->receive_text({data, bytes.size()});
    else
      peer_->receive_bytes({reinterpret_cast<const std::uint8_t*>(data), bytes.size()});
    buffer_.consume(bytes.size());
    if (buffer_.capacity() > peer_->longest_message()) buffer_.shrink_to_fit();
    socket_.read_message_max(peer_->longest_message());
  }

  void write() {
    if (is_writing_) return;
    auto next = peer_->next_message();
    if (!next && !peer_->is_over()) return;
    is_writing_ = true;
    start_write_timeout();
    if (!next) {
      const websocket::close_reason reason(websocket::close_code::normal);
      return socket_.async_close(reason, [self = this->shared_from_this()](Problem) { self->end(); });
    }
    outgoing_ = std::move(next->bytes);
    socket_.text(next->is_text);
    socket_.async_write(asio::buffer(*outgoing_),
                        [self = this->shared_from_this()](Problem problem, std::size_t) {
                          self->is_writing_ = false;
                          self->timeout_.cancel();
                          if (problem) return self->end();
                          self->write();
                        });
  }

  // Cuts the connection when the other side does not read.
  void start_write_timeout() {
    timeout_.expires_after(shared_->limits.write);
    timeout_.async_wait([weak = this->weak_from_this()](Problem problem) {
      const auto self = weak.lock();
      if (problem || !self) return;
      beast::get_lowest_layer(self->socket_).close();
    });
  }

  void end() {
    timeout_.cancel();
    peer_->close();
    beast::get_lowest_layer(socket_).close();
  }

  websocket::stream<Stream> socket_;
  SharedState* shared_;
  std::unique_ptr<ConnectionSlots::Slot> slot_;
  std::shared_ptr<WebSocketPeer> peer_;
  asio::steady_timer timeout_;
  beast::flat_buffer buffer_;
  std::shared_ptr<const std::string> outgoing_;
  bool is_writing_ = false;
};

// A connection that speaks HTTP, until it becomes a WebSocket.
template <class Stream>
class Connection : public std::enable_shared_from_this<Connection<Stream>> {
 public:
  Connection(Stream stream, SharedState* shared, std::unique_ptr<ConnectionSlots::Slot> slot)
      : stream_(std::move(stream)),
        shared_(shared),
        slot_(std::move(slot)),
        buffer_(shared->limits.header_bytes + k_chunk),
        timeout_(shared->io) {}

  void run() {
    wait_for_request();
    if constexpr (k_is_tls<Stream>) {
      beast::get_lowest_layer(stream_).expires_after(shared_->limits.read);
      stream_.async_handshake(asio::ssl::stream_base::server,
                              [self = this->shared_from_this()](Problem problem) {
                                if (!problem) self->begin();
                              });
    } else {
      begin();
    }
  }

 private:
  // Until a whole request has come, the connection may be closed for another one.
  void wait_for_request() {
    slot_->set_waiting([weak = this->weak_from_this()] {
      if (const auto self = weak.lock()) beast::get_lowest_layer(self->stream_).close();
    });
  }

  void begin() {
    if (slot_->kind() == ConnectionSlots::Kind::rejected)
      return write_last(error_response(k_http_unavailable, "too many connections. Try again in a moment."));
    read();
  }

  // Reads a whole request within the time limit. A client that is late within a request gets an answer.
  void read() {
    wait_for_request();
    parser_.emplace();
    parser_->header_limit(static_cast<std::uint32_t>(shared_->limits.header_bytes));
    parser_->body_limit(shared_->limits.body_bytes);
    beast::get_lowest_layer(stream_).expires_never();
    is_late_ = false;
    timeout_.expires_after(shared_->limits.read);
    timeout_.async_wait([weak = this->weak_from_this()](Problem problem) {
      const auto self = weak.lock();
      if (problem || !self) return;
      self->is_late_ = true;
      beast::get_lowest_layer(self->stream_).cancel();
    });
    http::async_read(stream_, buffer_, *parser_,
                     [self = this->shared_from_this()](Problem problem, std::size_t) {
                       self->timeout_.cancel();
                       problem ? self->reject(problem) : self->handle_request();
                     });
  }

  void reject(Problem problem) {
    const bool has_begun = parser_->got_some();
    if (is_late_)
      return has_begun ? write_last(error_response(k_http_timeout, "expected a whole request sooner."))
                       : close();
    if (problem == http::error::body_limit)
      return write_last(
          error_response(k_http_content_too_large,
                         fmt::format("expected a body of at most {} bytes.", shared_->limits.body_bytes)));
    if (problem == http::error::header_limit || problem == http::error::buffer_overflow)
      return write_last(
          error_response(k_http_headers_too_large,
                         fmt::format("expected headers of at most {} bytes.", shared_->limits.header_bytes)));
    if (problem.category() == http::make_error_code(http::error::bad_method).category() &&
        problem != http::error::end_of_stream && problem != http::error::partial_message)
      return write_last(error_response(k_http_bad_request, "expected a request of HTTP 1.1."));
    close();
  }

  static std::string text_of(beast::string_view view) { return {view.data(), view.size()}; }

  HttpRequest request() const {
    const auto& message = parser_->get();
    HttpRequest out;
    out.method = text_of(message.method_string());
    out.target = text_of(message.target());
    out.host = text_of(message[http::field::host]);
    out.origin = text_of(message[http::field::origin]);
    out.content_type = text_of(message[http::field::content_type]);
    out.authorization = text_of(message[http::field::authorization]);
    out.cookie = text_of(message[http::field::cookie]);
    out.if_none_match = text_of(message[http::field::if_none_match]);
    out.is_upgrade = websocket::is_upgrade(message);
    out.body = message.body();
    out.address = slot_->address();
    return out;
  }

  void handle_request() {
    slot_->set_busy();
    const HttpRequest received = request();
    is_head_ = received.method == "HEAD";
    keeps_alive_ = parser_->get().keep_alive();
    if (received.is_upgrade) {
      auto accepted = shared_->handler->accept_web_socket(received);
      if (auto* refused = std::get_if<HttpResponse>(&accepted)) return write_last(std::move(*refused));
      const auto socket =
          std::make_shared<Socket<Stream>>(std::move(stream_), shared_, std::move(slot_),
                                           std::move(std::get<std::shared_ptr<WebSocketPeer>>(accepted)));
      return socket->run(parser_->get());
    }
    shared_->handler->handle_request(
        received, shared_->on_network_thread([self = this->shared_from_this()](HttpResponse response) {
          self->write(std::move(response), self->keeps_alive_);
        }));
  }

  void write_last(HttpResponse response) { write(std::move(response), false); }

  void write(HttpResponse response, bool keeps_alive) {
    response_.emplace();
    response_->version(11);
    response_->result(static_cast<unsigned>(response.status));
    response_->keep_alive(keeps_alive);
    for (const auto& [name, value] : security_headers()) response_->set(name, value);
    if (!response.type.empty()) response_->set(http::field::content_type, response.type);
    if (response.status >= 400) response_->set(http::field::cache_control, "no-store");
    for (const auto& [name, value] : response.headers) response_->set(name, value);
    const bool has_length = response.status != 304;
    if (has_length) response_->content_length(response.body.size());
    if (!is_head_) response_->body() = std::move(response.body);
    beast::get_lowest_layer(stream_).expires_after(shared_->limits.write);
    http::async_write(stream_, *response_,
                      [self = this->shared_from_this(), keeps_alive](Problem problem, std::size_t) {
                        if (problem) return;
                        keeps_alive ? self->read() : self->close();
                      });
  }

  void close() {
    const auto drain = [this] {
      std::make_shared<DrainedClose>(std::move(beast::get_lowest_layer(stream_)), std::move(slot_))
          ->run(shared_->limits.drain);
    };
    if constexpr (k_is_tls<Stream>) {
      beast::get_lowest_layer(stream_).expires_after(shared_->limits.drain);
      stream_.async_shutdown([self = this->shared_from_this(), drain](Problem) { drain(); });
    } else {
      drain();
    }
  }

  Stream stream_;
  SharedState* shared_;
  std::unique_ptr<ConnectionSlots::Slot> slot_;
  beast::flat_buffer buffer_;
  asio::steady_timer timeout_;
  std::optional<http::request_parser<http::string_body>> parser_;
  std::optional<http::response<http::string_body>> response_;
  bool is_late_ = false, is_head_ = false, keeps_alive_ = false;
};

std::string text_of(const asio::ip::address& address) {
  if (address.is_v6() && address.to_v6().is_v4_mapped())
    return asio::ip::make_address_v4(asio::ip::v4_mapped, address.to_v6()).to_string();
  return address.to_string();
}

Result<asio::ssl::context> context_with(const Certificate& certificate) {
  asio::ssl::context out(asio::ssl::context::tls_server);
  Problem problem;
  SSL_CTX_set_min_proto_version(out.native_handle(), TLS1_2_VERSION);
  SSL_CTX_set_options(out.native_handle(), SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  out.use_certificate_chain(asio::buffer(certificate.pem), problem);
  if (!problem) out.use_private_key(asio::buffer(certificate.pem), asio::ssl::context::pem, problem);
  if (problem) return error("the certificate cannot be used: {}.", problem.message());
  return out;
}

}  // namespace

struct Network::Impl {
  explicit Impl(const NetworkLimits& limits)
      : slots(limits), acceptor(shared.io), pause(shared.io), ticker(shared.io), closing(shared.io) {
    shared.limits = limits;
  }

  void accept() {
    acceptor.async_accept([this](Problem problem, tcp::socket socket) {
      if (shared.is_closing) return;
      if (!problem) serve_connection(std::move(socket));
      if (!problem) return accept();
      pause.expires_after(k_accept_retry);
      pause.async_wait([this](Problem) { accept(); });
    });
  }

  void serve_connection(tcp::socket socket) {
    Problem problem;
    const auto endpoint = socket.remote_endpoint(problem);
    if (problem) return;
    auto slot = slots.acquire(text_of(endpoint.address()));
    if (!slot) return;
    socket.set_option(tcp::no_delay(true), problem);
    beast::tcp_stream stream(std::move(socket));
    if (shared.tls)
      std::make_shared<Connection<TlsStream>>(TlsStream(std::move(stream), *shared.tls), &shared,
                                              std::move(slot))
          ->run();
    else
      std::make_shared<Connection<PlainStream>>(std::move(stream), &shared, std::move(slot))->run();
  }

  void start_ticker() {
    ticker.expires_after(k_tick);
    ticker.async_wait([this](Problem problem) {
      if (problem || shared.is_closing) return;
      shared.handler->update_at(std::chrono::steady_clock::now());
      start_ticker();
    });
  }

  void run() try {
    step_back(k_nice);
    shared.io.run();
  } catch (const std::exception& bug) {
    log_warning("live: the remote stopped: this is a bug in Limn, please report it: {}", bug.what());
  }

  void close() {
    shared.is_closing = true;
    Problem ignored;
    acceptor.close(ignored);
    ticker.cancel();
    shared.handler->close_clients("the session has ended.");
    closing.expires_after(k_close_timeout);
    closing.async_wait([this](Problem) { shared.io.stop(); });
    await_empty();
  }

  // Ends as soon as no client is left.
  void await_empty() {
    if (shared.handler->client_count() == 0) return shared.io.stop();
    pause.expires_after(std::chrono::milliseconds(5));
    pause.async_wait([this](Problem) { await_empty(); });
  }

  ConnectionSlots slots;  // outlives the connections, which give their slots back
  SharedState shared;
  tcp::acceptor acceptor;
  asio::steady_timer pause, ticker, closing;
  std::thread thread;
};

Network::Network(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Result<std::unique_ptr<Network>> Network::open(const device::NetPlace& place,
                                               const std::optional<Certificate>& certificate,
                                               const NetworkLimits& limits) {
  auto impl = std::make_unique<Impl>(limits);
  Problem problem;
  const auto address = asio::ip::make_address(place.host, problem);
  if (problem) return usage_error("expected a numeric address of this machine, found '{}'.", place.host);
  if (certificate) {
    LIMN_TRY(impl->shared.tls, context_with(*certificate));
  }
  const tcp::endpoint endpoint(address, static_cast<unsigned short>(std::stoi(place.port)));
  tcp::acceptor& acceptor = impl->acceptor;
  acceptor.open(endpoint.protocol(), problem);
  if (!problem) acceptor.set_option(tcp::acceptor::reuse_address(true), problem);
  if (!problem && address.is_v6() && address.is_unspecified())
    acceptor.set_option(asio::ip::v6_only(false), problem);
  if (!problem) acceptor.bind(endpoint, problem);
  if (!problem) acceptor.listen(asio::socket_base::max_listen_connections, problem);
  if (problem)
    return error("{}:{}: expected a free port at an address of this machine, found: {}. Take another port.",
                 place.host, place.port, problem.message());
  return std::unique_ptr<Network>(new Network(std::move(impl)));
}

int Network::port() const {
  Problem ignored;
  return impl_->acceptor.local_endpoint(ignored).port();
}

void Network::start(HttpHandler* handler) {
  impl_->shared.handler = handler;
  impl_->accept();
  impl_->start_ticker();
  impl_->thread = std::thread([impl = impl_.get()] { impl->run(); });
}

void Network::post(std::function<void()> job) { asio::post(impl_->shared.io, std::move(job)); }

Network::~Network() { stop(); }

void Network::stop() {
  if (!impl_->thread.joinable()) return;
  post([impl = impl_.get()] { impl->close(); });
  impl_->thread.join();
}

}  // namespace limn::remote
