#include "remote/network.h"

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
#include "remote/own_addresses.h"

namespace limn::apps {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using Problem = beast::error_code;

constexpr auto k_tick = std::chrono::milliseconds(25);
constexpr auto k_closing = std::chrono::milliseconds(400);       // for goodbyes, at the end
constexpr auto k_accept_again = std::chrono::milliseconds(100);  // without handles for more
constexpr int k_nice = 5;                                        // the projectors' threads go first
constexpr std::size_t k_piece = 16 * 1024;                       // of what is thrown away
constexpr std::size_t k_longest_farewell = 32 * 1024 * 1024;     // bytes thrown away at most

using PlainStream = beast::tcp_stream;
using TlsStream = beast::ssl_stream<beast::tcp_stream>;

template <class Stream>
constexpr bool k_is_tls = std::is_same_v<Stream, TlsStream>;

// Who is connected from where.
class Seats {
 public:
  explicit Seats(const NetworkLimits& limits) : limits_(limits) {}

  enum class Kind { served, turned_away };
  // Given back when it goes.
  class Seat {
   public:
    Seat(Seats* seats, std::string address, Kind kind)
        : seats_(seats), address_(std::move(address)), kind_(kind) {
      seats_->count(address_, kind_, 1);
    }
    Seat(const Seat&) = delete;
    Seat& operator=(const Seat&) = delete;
    ~Seat() { seats_->count(address_, kind_, -1); }
    const std::string& address() const { return address_; }
    Kind kind() const { return kind_; }

   private:
    Seats* seats_;
    std::string address_;
    Kind kind_;
  };

  // Null: none is left, not even to be told so.
  std::unique_ptr<Seat> seat(const std::string& address) {
    const auto of_address = of_address_.find(address);
    const bool is_greedy = of_address != of_address_.end() && !is_loopback(address) &&
                           of_address->second >= static_cast<int>(limits_.of_one_address);
    const bool is_full = served_ >= static_cast<int>(limits_.connections);
    if (!is_full && !is_greedy) return std::make_unique<Seat>(this, address, Kind::served);
    if (turned_away_ >= static_cast<int>(limits_.turned_away)) return nullptr;
    return std::make_unique<Seat>(this, address, Kind::turned_away);
  }

 private:
  void count(const std::string& address, Kind kind, int change) {
    if (kind == Kind::turned_away) {
      turned_away_ += change;
      return;
    }
    served_ += change;
    if ((of_address_[address] += change) == 0) of_address_.erase(address);
  }

  NetworkLimits limits_;
  int served_ = 0, turned_away_ = 0;
  std::map<std::string, int> of_address_;
};

// What connections share.
struct House {
  asio::io_context io{1};
  std::optional<asio::ssl::context> tls;
  NetworkLimits limits;
  Reception* reception = nullptr;
  bool is_closing = false;

  // Connections that wait for an answer: other threads get a number, so that a connection lives and ends on
  // the network's thread alone.
  std::map<std::uint64_t, Answering> waiting;
  std::uint64_t last_waiting = 0;

  Answering ticket_of(Answering answering) {
    waiting.emplace(++last_waiting, std::move(answering));
    return [this, ticket = last_waiting](HttpAnswer answer) {
      asio::post(io, [this, ticket, answer = std::move(answer)]() mutable {
        const auto found = waiting.extract(ticket);
        if (!found.empty()) found.mapped()(std::move(answer));
      });
    };
  }
};

// Closes a connection so that what was said last arrives: what still comes is read for a moment and thrown
// away.
class Farewell : public std::enable_shared_from_this<Farewell> {
 public:
  Farewell(beast::tcp_stream stream, std::unique_ptr<Seats::Seat> seat)
      : stream_(std::move(stream)), seat_(std::move(seat)) {}

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
                              self->thrown_away_ += count;
                              if (!problem && self->thrown_away_ < k_longest_farewell) self->read();
                            });
  }

  beast::tcp_stream stream_;
  std::unique_ptr<Seats::Seat> seat_;
  std::array<char, k_piece> bytes_{};
  std::size_t thrown_away_ = 0;
};

// A guest's WebSocket. One message is written at a time; the Visitor's outbox holds what comes next.
template <class Stream>
class Socket : public std::enable_shared_from_this<Socket<Stream>> {
 public:
  Socket(Stream stream, House* house, std::unique_ptr<Seats::Seat> seat, std::shared_ptr<WsClient> client)
      : socket_(std::move(stream)),
        house_(house),
        seat_(std::move(seat)),
        visitor_(std::move(client)),
        late_(house->io) {}

  template <class Request>
  void run(const Request& request) {
    beast::get_lowest_layer(socket_).expires_never();  // the WebSocket has its own limits
    websocket::stream_base::timeout limits{house_->limits.read, house_->limits.silence, true};
    socket_.set_option(limits);
    socket_.auto_fragment(false);
    socket_.read_message_max(visitor_->longest_message());
    socket_.async_accept(request, [self = this->shared_from_this()](Problem problem) {
      if (problem) return;
      self->visitor_->wake = [weak = self->weak_from_this()] {
        if (const auto self = weak.lock()) self->write();
      };
      self->house_->reception->greet(self->visitor_);
      self->read();
    });
  }

 private:
  void read() {
    socket_.async_read(buffer_, [self = this->shared_from_this()](Problem problem, std::size_t) {
      if (problem) return self->end();
      self->hear();
      self->read();
    });
  }

  void hear() {
    const auto bytes = buffer_.cdata();
    const auto* data = static_cast<const char*>(bytes.data());
    if (socket_.got_text())
      house_->reception->hear_text(visitor_, {data, bytes.size()});
    else
      house_->reception->hear_bytes(visitor_, {reinterpret_cast<const std::uint8_t*>(data), bytes.size()});
    buffer_.consume(bytes.size());
    if (buffer_.capacity() > visitor_->longest_message()) buffer_.shrink_to_fit();
    socket_.read_message_max(visitor_->longest_message());
  }

  void write() {
    if (is_writing_) return;
    auto next = visitor_->outbox.next();
    if (!next && !visitor_->outbox.is_over()) return;
    is_writing_ = true;
    be_late();
    if (!next) {
      const websocket::close_reason reason(websocket::close_code::normal);
      return socket_.async_close(reason, [self = this->shared_from_this()](Problem) { self->end(); });
    }
    outgoing_ = std::move(next->bytes);
    socket_.text(next->is_text);
    socket_.async_write(asio::buffer(*outgoing_),
                        [self = this->shared_from_this()](Problem problem, std::size_t) {
                          self->is_writing_ = false;
                          self->late_.cancel();
                          if (problem) return self->end();
                          self->write();
                        });
  }

  // Nobody reads: the connection is cut.
  void be_late() {
    late_.expires_after(house_->limits.write);
    late_.async_wait([weak = this->weak_from_this()](Problem problem) {
      const auto self = weak.lock();
      if (problem || !self) return;
      beast::get_lowest_layer(self->socket_).close();
    });
  }

  void end() {
    late_.cancel();
    house_->reception->gone(visitor_);
    beast::get_lowest_layer(socket_).close();
  }

  websocket::stream<Stream> socket_;
  House* house_;
  std::unique_ptr<Seats::Seat> seat_;
  std::shared_ptr<WsClient> visitor_;
  asio::steady_timer late_;
  beast::flat_buffer buffer_;
  std::shared_ptr<const std::string> outgoing_;
  bool is_writing_ = false;
};

// A connection that speaks HTTP, until it becomes a WebSocket.
template <class Stream>
class Connection : public std::enable_shared_from_this<Connection<Stream>> {
 public:
  Connection(Stream stream, House* house, std::unique_ptr<Seats::Seat> seat)
      : stream_(std::move(stream)),
        house_(house),
        seat_(std::move(seat)),
        buffer_(house->limits.header_bytes + k_piece),
        late_(house->io) {}

  void run() {
    if constexpr (k_is_tls<Stream>) {
      beast::get_lowest_layer(stream_).expires_after(house_->limits.read);
      stream_.async_handshake(asio::ssl::stream_base::server,
                              [self = this->shared_from_this()](Problem problem) {
                                if (!problem) self->begin();
                              });
    } else {
      begin();
    }
  }

 private:
  void begin() {
    if (seat_->kind() == Seats::Kind::turned_away)
      return write_last(refusal(503, "too many connections. Try again in a moment."));
    read();
  }

  // A whole request within the time; whoever has begun one and is late is told so.
  void read() {
    parser_.emplace();
    parser_->header_limit(static_cast<std::uint32_t>(house_->limits.header_bytes));
    parser_->body_limit(house_->limits.body_bytes);
    beast::get_lowest_layer(stream_).expires_never();
    is_late_ = false;
    late_.expires_after(house_->limits.read);
    late_.async_wait([weak = this->weak_from_this()](Problem problem) {
      const auto self = weak.lock();
      if (problem || !self) return;
      self->is_late_ = true;
      beast::get_lowest_layer(self->stream_).cancel();
    });
    http::async_read(stream_, buffer_, *parser_,
                     [self = this->shared_from_this()](Problem problem, std::size_t) {
                       self->late_.cancel();
                       problem ? self->refuse(problem) : self->take();
                     });
  }

  void refuse(Problem problem) {
    const bool has_begun = parser_->got_some();
    if (is_late_) return has_begun ? write_last(refusal(408, "expected a whole request sooner.")) : close();
    if (problem == http::error::body_limit)
      return write_last(
          refusal(413, fmt::format("expected a body of at most {} bytes.", house_->limits.body_bytes)));
    if (problem == http::error::header_limit || problem == http::error::buffer_overflow)
      return write_last(
          refusal(431, fmt::format("expected headers of at most {} bytes.", house_->limits.header_bytes)));
    if (problem.category() == http::make_error_code(http::error::bad_method).category() &&
        problem != http::error::end_of_stream && problem != http::error::partial_message)
      return write_last(refusal(400, "expected a request of HTTP 1.1."));
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
    out.address = seat_->address();
    return out;
  }

  void take() {
    const HttpRequest asked = request();
    is_head_ = asked.method == "HEAD";
    keeps_alive_ = parser_->get().keep_alive();
    if (asked.is_upgrade) {
      auto admitted = house_->reception->admit(asked);
      if (auto* refused = std::get_if<HttpAnswer>(&admitted)) return write_last(std::move(*refused));
      const auto socket =
          std::make_shared<Socket<Stream>>(std::move(stream_), house_, std::move(seat_),
                                           std::move(std::get<std::shared_ptr<WsClient>>(admitted)));
      return socket->run(parser_->get());
    }
    house_->reception->answer(asked, house_->ticket_of([self = this->shared_from_this()](HttpAnswer answer) {
      self->write(std::move(answer), self->keeps_alive_);
    }));
  }

  void write_last(HttpAnswer answer) { write(std::move(answer), false); }

  void write(HttpAnswer answer, bool keeps_alive) {
    response_.emplace();
    response_->version(11);
    response_->result(static_cast<unsigned>(answer.status));
    response_->keep_alive(keeps_alive);
    for (const auto& [name, value] : guarding_headers()) response_->set(name, value);
    if (!answer.type.empty()) response_->set(http::field::content_type, answer.type);
    if (answer.status >= 400) response_->set(http::field::cache_control, "no-store");
    for (const auto& [name, value] : answer.headers) response_->set(name, value);
    const bool has_length = answer.status != 304;
    if (has_length) response_->content_length(answer.body.size());
    if (!is_head_) response_->body() = std::move(answer.body);
    beast::get_lowest_layer(stream_).expires_after(house_->limits.write);
    http::async_write(stream_, *response_,
                      [self = this->shared_from_this(), keeps_alive](Problem problem, std::size_t) {
                        if (problem) return;
                        keeps_alive ? self->read() : self->close();
                      });
  }

  void close() {
    const auto farewell = [this] {
      std::make_shared<Farewell>(std::move(beast::get_lowest_layer(stream_)), std::move(seat_))
          ->run(house_->limits.farewell);
    };
    if constexpr (k_is_tls<Stream>) {
      beast::get_lowest_layer(stream_).expires_after(house_->limits.farewell);
      stream_.async_shutdown([self = this->shared_from_this(), farewell](Problem) { farewell(); });
    } else {
      farewell();
    }
  }

  Stream stream_;
  House* house_;
  std::unique_ptr<Seats::Seat> seat_;
  beast::flat_buffer buffer_;
  asio::steady_timer late_;
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
      : seats(limits), acceptor(house.io), pause(house.io), ticker(house.io), closing(house.io) {
    house.limits = limits;
  }

  void accept() {
    acceptor.async_accept([this](Problem problem, tcp::socket socket) {
      if (house.is_closing) return;
      if (!problem) greet(std::move(socket));
      if (!problem) return accept();
      pause.expires_after(k_accept_again);
      pause.async_wait([this](Problem) { accept(); });
    });
  }

  void greet(tcp::socket socket) {
    Problem problem;
    const auto endpoint = socket.remote_endpoint(problem);
    if (problem) return;
    auto seat = seats.seat(text_of(endpoint.address()));
    if (!seat) return;
    socket.set_option(tcp::no_delay(true), problem);
    beast::tcp_stream stream(std::move(socket));
    if (house.tls)
      std::make_shared<Connection<TlsStream>>(TlsStream(std::move(stream), *house.tls), &house,
                                              std::move(seat))
          ->run();
    else
      std::make_shared<Connection<PlainStream>>(std::move(stream), &house, std::move(seat))->run();
  }

  void tick() {
    ticker.expires_after(k_tick);
    ticker.async_wait([this](Problem problem) {
      if (problem || house.is_closing) return;
      house.reception->tick(std::chrono::steady_clock::now());
      tick();
    });
  }

  void run() try {
    step_back(k_nice);
    house.io.run();
  } catch (const std::exception& bug) {
    log_warning("live: the remote stopped: this is a bug in Limn, please report it: {}", bug.what());
  }

  void close() {
    house.is_closing = true;
    Problem ignored;
    acceptor.close(ignored);
    ticker.cancel();
    house.reception->close("the session has ended.");
    closing.expires_after(k_closing);
    closing.async_wait([this](Problem) { house.io.stop(); });
    await_empty();
  }

  // Ends at once when nobody is left.
  void await_empty() {
    if (house.reception->client_count() == 0) return house.io.stop();
    pause.expires_after(std::chrono::milliseconds(5));
    pause.async_wait([this](Problem) { await_empty(); });
  }

  Seats seats;  // connections give back to it
  House house;
  tcp::acceptor acceptor;
  asio::steady_timer pause, ticker, closing;
  std::thread thread;
};

Network::Network(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Result<std::unique_ptr<Network>> Network::open(const NetPlace& place,
                                               const std::optional<Certificate>& certificate,
                                               const NetworkLimits& limits) {
  auto impl = std::make_unique<Impl>(limits);
  Problem problem;
  const auto address = asio::ip::make_address(place.host, problem);
  if (problem) return usage_error("expected a numeric address of this machine, found '{}'.", place.host);
  if (certificate) {
    LIMN_TRY(impl->house.tls, context_with(*certificate));
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

void Network::start(Reception* reception) {
  impl_->house.reception = reception;
  impl_->accept();
  impl_->tick();
  impl_->thread = std::thread([impl = impl_.get()] { impl->run(); });
}

void Network::post(std::function<void()> job) { asio::post(impl_->house.io, std::move(job)); }

Network::~Network() { stop(); }

void Network::stop() {
  if (!impl_->thread.joinable()) return;
  post([impl = impl_.get()] { impl->close(); });
  impl_->thread.join();
}

}  // namespace limn::apps
