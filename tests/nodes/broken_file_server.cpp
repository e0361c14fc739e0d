#include "tests/nodes/broken_file_server.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <thread>

#include "remote/http/certificate.h"

namespace limn::test {

struct BrokenFileServer::Impl {
  std::function<void(const Send&)> answer;
  remote::Certificate certificate = remote::make_certificate({"localhost"});
  SSL_CTX* context = SSL_CTX_new(TLS_server_method());
  int handle = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  int port = 0;
  std::atomic<int> connections = 0, requests = 0;
  std::thread thread;

  void listen() {
    std::signal(SIGPIPE, SIG_IGN);  // OpenSSL writes to connections that the node has closed
    BIO* text = BIO_new_mem_buf(certificate.pem.data(), static_cast<int>(certificate.pem.size()));
    EVP_PKEY* key = PEM_read_bio_PrivateKey(text, nullptr, nullptr, nullptr);
    X509* own = PEM_read_bio_X509(text, nullptr, nullptr, nullptr);
    SSL_CTX_use_certificate(context, own);
    SSL_CTX_use_PrivateKey(context, key);
    X509_free(own);
    EVP_PKEY_free(key);
    BIO_free(text);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    ::bind(handle, reinterpret_cast<const sockaddr*>(&address), length);
    ::getsockname(handle, reinterpret_cast<sockaddr*>(&address), &length);
    port = ntohs(address.sin_port);
    ::listen(handle, 8);
  }

  void run() {
    for (int client = 0; (client = ::accept(handle, nullptr, nullptr)) >= 0; ::close(client)) serve(client);
  }

  void serve(int client) {
    SSL* session = SSL_new(context);
    SSL_set_fd(session, client);
    std::array<char, 4096> bytes{};
    if (SSL_accept(session) == 1) {
      ++connections;
      if (SSL_read(session, bytes.data(), static_cast<int>(bytes.size())) > 0) {
        ++requests;
        answer([session](std::string_view out) {
          SSL_write(session, out.data(), static_cast<int>(out.size()));
        });
      }
    }
    SSL_free(session);
  }
};

BrokenFileServer::BrokenFileServer(std::function<void(const Send&)> answer)
    : impl_(std::make_unique<Impl>()) {
  impl_->answer = std::move(answer);
  impl_->listen();
  impl_->thread = std::thread([impl = impl_.get()] { impl->run(); });
}

BrokenFileServer::~BrokenFileServer() {
  ::shutdown(impl_->handle, SHUT_RDWR);
  impl_->thread.join();
  ::close(impl_->handle);
  SSL_CTX_free(impl_->context);
}

nodes::Offer BrokenFileServer::offer() const {
  nodes::Offer out;
  out.servers = {fmt::format("127.0.0.1:{}", impl_->port)};
  out.fingerprint = impl_->certificate.fingerprint;
  out.token = "0123456789abcdef0123456789abcdef";
  return out;
}

int BrokenFileServer::connections() const { return impl_->connections; }

int BrokenFileServer::requests() const { return impl_->requests; }

}  // namespace limn::test
